// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/helpers.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::textured_room(small_recipe(width_of_any(200)));
  return kRoom;
}

const DepthMap& room_map() {
  static const DepthMap kMap = match(room(), 1);
  return kMap;
}

/// The image of a camera turned right by `columns`, turned back.
Image<float> turned_back(const Image<float>& image, int columns) {
  Image<float> result(image.width(), image.height());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) result((x + columns) % image.width(), y) = image(x, y);
  }
  return result;
}

}  // namespace

TEST_CASE("same input and seed, same bytes", "[patchmatch]") { CHECK(same(match(room(), 1), room_map())); }

TEST_CASE("the number of threads changes no byte", "[patchmatch]") {
  for (const int threads : {1, 2, 5}) {
    MatchSetup setup;
    setup.threads = threads;
    INFO(threads);
    CHECK(same(match(room(), 1, setup), room_map()));
  }
}

TEST_CASE("another seed gives other bytes of the same quality", "[patchmatch]" PMSP_ACCURACY) {
  const Image<float>& truth = room().frames[1].depth;
  MatchSetup setup;
  setup.seed = 12345;
  const DepthMap other = match(room(), 1, setup);
  CHECK_FALSE(same(other, room_map()));
  const double first = synth::share_within(room_map().depth, truth, 0.02);
  const double second = synth::share_within(other.depth, truth, 0.02);
  CAPTURE(first, second);
  CHECK(std::abs(first - second) < 0.02);
}

TEST_CASE("another keyframe id draws other numbers", "[patchmatch]") {
  synth::Mission mission = room();
  mission.frames[1].id = 77;
  CHECK_FALSE(same(match(mission, 1).depth, room_map().depth));
}

TEST_CASE("two neighbours in the other order give the same bytes", "[patchmatch]") {
  MatchSetup setup;
  setup.neighbours = {2, 0};
  CHECK(same(match(room(), 1, setup), room_map()));
}

TEST_CASE("all instruction sets agree", "[patchmatch]" PMSP_ACCURACY) {
  const std::vector<Simd> sets = available_simd();
  REQUIRE(sets.front() == Simd::kScalar);
  MatchSetup setup;
  setup.simd = Simd::kScalar;
  const DepthMap plain = match(room(), 1, setup);
  for (const Simd simd : sets) {
    INFO(name_of(simd));
    setup.simd = simd;
    const double share = agreement(match(room(), 1, setup).depth, plain.depth, 0.01);
    CAPTURE(share);
    CHECK(share >= 0.99);
  }
}

TEST_CASE("each instruction set gives the same bytes for any number of threads", "[patchmatch]") {
  for (const Simd simd : available_simd()) {
    INFO(name_of(simd));
    MatchSetup setup;
    setup.simd = simd;
    setup.options.iterations = 1;
    setup.threads = 1;
    const DepthMap one = match(room(), 1, setup);
    setup.threads = 3;
    CHECK(same(match(room(), 1, setup), one));
  }
}

TEST_CASE("the result turns with the camera", "[patchmatch]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::sphere_inside(small_recipe(256));
  const DepthMap original = match(mission, 1);
  const double before = synth::share_within(original.depth, mission.frames[1].depth, 0.02);
  for (const int columns : {64, 128, 37}) {  // 90, 180 and another angle
    INFO(columns);
    const synth::Mission turned = synth::turned(mission, columns);
    const DepthMap map = match(turned, 1);
    const double agreeing = agreement(turned_back(map.depth, columns), original.depth, 0.02);
    const double after = synth::share_within(map.depth, turned.frames[1].depth, 0.02);
    CAPTURE(agreeing, before, after);
    CHECK(agreeing > (columns % 2 == 0 ? 0.95 : 0.86));  // an odd turn swaps red and black pixels
    CHECK(std::abs(after - before) < 0.015);
  }
}

TEST_CASE("a furnished room is found equally well for any camera orientation", "[patchmatch]" PMSP_ACCURACY) {
  const double before = synth::share_within(room_map().depth, room().frames[1].depth, 0.02);
  for (const int columns : {50, 100}) {
    INFO(columns);
    const synth::Mission turned = synth::turned(room(), columns);
    const DepthMap map = match(turned, 1);
    const double agreeing = agreement(turned_back(map.depth, columns), room_map().depth, 0.05);
    const double after = synth::share_within(map.depth, turned.frames[1].depth, 0.02);
    CAPTURE(agreeing, before, after);
    CHECK(agreeing > 0.9);
    CHECK(std::abs(after - before) < 0.015);
  }
}

TEST_CASE("the unit of length does not affect the result", "[patchmatch]" PMSP_ACCURACY) {
  for (const double factor : {0.01, 100.0}) {
    INFO(factor);
    DepthMap map = match(synth::scaled(room(), factor), 1);
    for (float& depth : map.depth.pixels()) depth = static_cast<float>(depth / factor);
    const double share = agreement(map.depth, room_map().depth, 0.005);
    CAPTURE(share);
    CHECK(share >= 0.99);
  }
}

TEST_CASE("more iterations do not make it worse", "[patchmatch]" PMSP_ACCURACY) {
  const Image<float>& truth = room().frames[1].depth;
  const auto share = [&](int iterations) {
    MatchSetup setup;
    setup.options.iterations = iterations;
    return synth::share_within(match(room(), 1, setup).depth, truth, 0.02);
  };
  const double one = share(1);
  const double four = synth::share_within(room_map().depth, truth, 0.02);
  CAPTURE(one, four);
  CHECK(four > one);
}

TEST_CASE("exposure changes between images have little effect", "[patchmatch]" PMSP_ACCURACY) {
  synth::Mission mission = room();
  for (Rgb& pixel : mission.frames[2].image.pixels()) {
    const auto darker = [](std::uint8_t v) { return static_cast<std::uint8_t>(std::lround(0.75 * v)); };
    pixel = {darker(pixel.r), darker(pixel.g), darker(pixel.b)};
  }
  const double share = agreement(match(mission, 1).depth, room_map().depth, 0.02);
  CAPTURE(share);
  CHECK(share > 0.93);
}

TEST_CASE("a cancelled run returns an empty map", "[patchmatch]") {
  const Executor executor(1);
  const Image<Rgb> pixels(64, 32);
  const Panorama panorama(pixels.view(), {}, 64, 32, executor);
  const RigidTransform moved{Eigen::Matrix3d::Identity(), Eigen::Vector3d(1.0, 0.0, 0.0)};
  const std::atomic<bool> cancel{true};
  const PlaneMap map =
      patchmatch({7, {&panorama, {}}, {{&panorama, moved}}, {0.5, 2.0}}, PatchMatchOptions{}, 1, executor, &cancel);
  CHECK(map.empty());
}
