// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <utility>
#include <vector>

#include "core/helpers.h"
#include "core/on_depth_maps.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 80;

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::empty_room(small_recipe(kWidth, 1));
  return kRoom;
}

void erase(DepthMap& map, int x, int y) {
  map.depth(x, y) = 0.0F;
  map.normal(x, y).setZero();
  map.confidence(x, y) = 0.0F;
}

FilterStats run(DepthMap& map, const MedianFilterOptions& options = median_on(), int threads = 2) {
  FilterStats stats;
  median_filter(map, options, Executor(threads), &stats);
  return stats;
}

}  // namespace

TEST_CASE("the median filter keeps smooth surfaces as they are", "[median]") {
  const DepthMap truth = truth_map(room().frames[0]);
  DepthMap map = truth;
  const FilterStats stats = run(map);
  CHECK(stats.before == kWidth * kHeight);
  CHECK(stats.after >= kWidth * kHeight * 998 / 1000);
  int changed = 0;
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    const float depth = map.depth.pixels()[i];
    changed += depth > 0.0F && (depth != truth.depth.pixels()[i] || map.normal.pixels()[i] != truth.normal.pixels()[i])
                   ? 1
                   : 0;
  }
  CHECK(changed == 0);
}

TEST_CASE("the median filter drops single outliers anywhere on the sphere", "[median]") {
  const std::vector<std::pair<int, int>> places = {{80, 40}, {0, 40},  {kWidth - 1, 30}, {20, 0},
                                                   {0, 0},   {50, 79}, {kWidth - 1, 79}, {121, 1}};
  for (const float factor : {0.2F, 0.9F, 1.1F, 5.0F}) {
    DepthMap map = truth_map(room().frames[0]);
    for (const auto& [x, y] : places) map.depth(x, y) *= factor;
    run(map);
    for (const auto& [x, y] : places) {
      INFO(x << ", " << y << " times " << factor);
      CHECK(map.depth(x, y) == 0.0F);
      CHECK(map.normal(x, y).norm() == 0.0F);
      CHECK(map.confidence(x, y) == 0.0F);
      CHECK(map.depth((x + 1) % kWidth, y) > 0.0F);  // adjacent pixels stay
      CHECK(map.depth((x + kWidth - 1) % kWidth, y) > 0.0F);
    }
  }
}

TEST_CASE("the median filter wraps over the seam and over the poles", "[median]") {
  // The left half sees one wall, the right half another; a pixel that matches only what lies beyond the border stays.
  DepthMap map = truth_map(room().frames[0]);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) map.depth(x, y) = x < 2 || x >= kWidth - 1 ? 4.0F : 2.0F;
  }
  run(map);
  CHECK(map.depth(kWidth - 1, 40) == 4.0F);  // alone in its columns, but six of its nine neighbours are like it
  map = truth_map(room().frames[0]);
  map.depth = Image<float>(kWidth, kHeight, 2.0F);
  for (int x = 39; x <= 41; ++x) map.depth(x, 0) = 4.0F;          // three beside each other at the pole ...
  for (int x = 119; x <= 121; ++x) map.depth(x, 0) = 4.0F;        // ... and three across it
  map.depth(10, 0) = map.depth(11, 0) = map.depth(12, 0) = 4.0F;  // nothing across these
  run(map);
  CHECK(map.depth(40, 0) == 4.0F);
  CHECK(map.depth(120, 0) == 4.0F);
  CHECK(map.depth(11, 0) == 0.0F);
}

TEST_CASE("the median filter drops low scores if enabled", "[median]") {
  DepthMap map = truth_map(room().frames[0], 0.5F);
  map.confidence(30, 30) = 0.09F;
  map.confidence(31, 30) = 0.11F;
  DepthMap all = map;
  run(all);
  CHECK(all.depth(30, 30) > 0.0F);
  MedianFilterOptions options = median_on();
  options.min_score = 0.1;
  run(map, options);
  CHECK(map.depth(30, 30) == 0.0F);
  CHECK(map.depth(31, 30) > 0.0F);
  CHECK(map.confidence(31, 30) == 0.11F);
}

TEST_CASE("the median filter ignores holes and fills none", "[median]") {
  DepthMap map = truth_map(room().frames[0]);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if ((x + y) % 2 != 0) erase(map, x, y);
    }
  }
  const FilterStats stats = run(map);
  CHECK(stats.before == kWidth * kHeight / 2);
  CHECK(stats.after >= stats.before * 995 / 1000);
  CHECK(map.depth(41, 40) == 0.0F);
}

TEST_CASE("the median filter uses the tolerance of the options", "[median]") {
  DepthMap base = truth_map(room().frames[0]);
  base.depth = Image<float>(kWidth, kHeight, 2.0F);
  base.depth(60, 40) = 2.0F * 1.08F;
  MedianFilterOptions options = median_on();
  for (const auto& [tolerance, kept] : {std::pair{0.07, false}, {0.09, true}}) {
    DepthMap map = base;
    options.max_relative_deviation = tolerance;
    run(map, options);
    CHECK((map.depth(60, 40) > 0.0F) == kept);
  }
}

TEST_CASE("a disabled median filter changes nothing and invalid options are refused", "[median]") {
  DepthMap map = truth_map(room().frames[0], 0.01F);
  const DepthMap before = map;
  MedianFilterOptions options = median_on();
  options.enabled = false;
  const FilterStats stats = run(map, options);
  CHECK(same(map, before));
  CHECK(stats.before == stats.after);
  options.min_score = 2.0;
  CHECK_THROWS_AS(run(map, options), InvalidOption);
}

TEST_CASE("the median filter gives the same bytes for any threads and instruction set", "[median]") {
  DepthMap noisy = truth_map(room().frames[0], 0.4F);
  for (std::size_t i = 0; i < noisy.depth.size(); ++i)
    noisy.depth.pixels()[i] *= static_cast<float>(1.0 + 0.05 * synth::gaussian(3, i));
  DepthMap expected = noisy;
  median_filter(expected, median_on(), Executor(1, Simd::kScalar));
  CHECK(filled(expected.depth) > 0.3);
  CHECK(filled(expected.depth) < 0.95);
  for (const Simd simd : available_simd()) {
    for (const int threads : {1, 3}) {
      DepthMap map = noisy;
      median_filter(map, median_on(), Executor(threads, simd));
      INFO(name_of(simd) << ", " << threads << " threads");
      CHECK(same(map, expected));
    }
  }
}
