// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/helpers.h"
#include "pmsp/camera.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = kSanitized ? 64 : 256;
constexpr int kHeight = kWidth / 2;

/// Regions fixed to the camera: the lower rows, as a drone's body, and a blob across the seam.
bool is_masked(int x, int y, int margin = 0) {
  const int from_seam = std::min(x, kWidth - 1 - x);
  return y >= kHeight * 5 / 6 - margin ||
         (from_seam < kWidth / 18 + margin && std::abs(y - kHeight / 2) < kHeight / 9 + margin);
}

synth::Mission with_mask(synth::Mission mission) {
  mission.mask = Image<std::uint8_t>(kWidth, kHeight, 255);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) mission.mask(x, y) = is_masked(x, y) ? 0 : 255;
  }
  return mission;
}

/// The same strong pattern in all images, as of a rig.
synth::Mission with_garbage(synth::Mission mission) {
  for (synth::Frame& frame : mission.frames) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto level = static_cast<std::uint8_t>(128.0 + 90.0 * std::sin(0.9 * x + 0.3 * y) * std::cos(0.7 * y));
        if (is_masked(x, y)) frame.image(x, y) = {level, level, level};
      }
    }
  }
  return mission;
}

/// Whether a neighbour's mask hides what a pixel of frame 1 sees.
bool hidden_in(const synth::Mission& mission, std::size_t neighbour, int x, int y) {
  const synth::Frame& frame = mission.frames[1];
  const Eigen::Vector3d p =
      mission.frames[neighbour].cam_from_world *
      (frame.cam_from_world.inverse() * (static_cast<double>(frame.depth(x, y)) * bearing_of(frame.depth, x, y)));
  const Eigen::Vector2d at = pixel_from_bearing(p, kWidth, kHeight);
  return is_masked(std::min(static_cast<int>(at.x()), kWidth - 1), std::min(static_cast<int>(at.y()), kHeight - 1));
}

bool is_outside(int x, int y) { return !is_masked(x, y, 10); }

}  // namespace

TEST_CASE("masked pixels have no depth and are not counted", "[patchmatch][mask]") {
  const synth::Mission mission = with_mask(synth::textured_room(small_recipe(kWidth)));
  MatchStats stats;
  const DepthMap map = match(mission, 1, {}, &stats);
  int masked_with_depth = 0;
  std::int64_t unmasked = 0;
  std::int64_t unmasked_with_depth = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool has = map.depth(x, y) > 0.0F;
      masked_with_depth +=
          is_masked(x, y) && (has || map.normal(x, y).norm() > 0.0F || map.confidence(x, y) > 0.0F) ? 1 : 0;
      unmasked += is_masked(x, y) ? 0 : 1;
      unmasked_with_depth += !is_masked(x, y) && has ? 1 : 0;
    }
  }
  CHECK(masked_with_depth == 0);
  CHECK(stats.pixels == unmasked);
  CHECK(stats.matched == unmasked_with_depth);
  CHECK(unmasked_with_depth > unmasked * 95 / 100);
}

TEST_CASE("masked pixels of the reference and source views do not affect the result",
          "[patchmatch][mask]" PMSP_ACCURACY) {
  const synth::Mission clean = synth::textured_room(small_recipe(kWidth));
  const Image<float>& truth = clean.frames[1].depth;
  const DepthMap masked = match(with_mask(clean), 1);
  const DepthMap masked_garbage = match(with_mask(with_garbage(clean)), 1);
  const DepthMap garbage = match(with_garbage(clean), 1);
  const auto share = [&](const DepthMap& map) { return synth::share_within(map.depth, truth, 0.02, is_outside); };
  CAPTURE(share(masked), share(masked_garbage), share(garbage));
  CHECK(std::abs(share(masked_garbage) - share(masked)) < 0.01);
  const double unchanged = synth::share_within(masked_garbage.depth, masked.depth, 0.01, is_outside);
  CAPTURE(unchanged);
  CHECK(unchanged > 0.97);
  // Pixels whose surface is masked in the earlier source view and visible in the later one: without the mask, the
  // pattern affects them.
  const auto half_hidden = [&](int x, int y) {
    return !is_masked(x, y, 4) && hidden_in(clean, 0, x, y) && !hidden_in(clean, 2, x, y);
  };
  const double with_mask = synth::share_within(masked_garbage.depth, truth, 0.02, half_hidden);
  const double without = synth::share_within(garbage.depth, truth, 0.02, half_hidden);
  CAPTURE(with_mask, without);
  CHECK(with_mask > without);
}

TEST_CASE("a mask of all 255 is no mask", "[patchmatch][mask]" PMSP_ACCURACY) {
  synth::Mission mission = synth::sphere_inside(small_recipe(width_of_any(128)));
  const DepthMap without = match(mission, 1);
  mission.mask = Image<std::uint8_t>(mission.width, mission.height, 1);  // any value but 0 means use
  CHECK(agreement(match(mission, 1).depth, without.depth, 0.001) > 0.99);
}

TEST_CASE("a mask of all 0 leaves an empty map", "[patchmatch][mask]") {
  synth::Mission mission = synth::sphere_inside(small_recipe(width_of_any(128)));
  mission.mask = Image<std::uint8_t>(mission.width, mission.height, 0);
  MatchStats stats;
  const DepthMap map = match(mission, 1, {}, &stats);
  CHECK(filled(map.depth) == 0.0);
  CHECK(stats.pixels == 0);
  CHECK(stats.matched == 0);
}
