// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>

#include "core/recording.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = 640;

struct Accuracy {
  double all = 0.0;
  double off_axis = 0.0;
};

/// The raw depth map of the keyframe in the middle of three, by the online preset.
DepthMap raw_depth_of_middle(const synth::Mission& mission) {
  DepthMap middle;
  Densifier* running = nullptr;
  DensifierCallbacks callbacks;
  callbacks.raw_depth = [&](const DepthMap& map) {
    if (map.keyframe_id != mission.frames[1].id) return;
    middle = map;
    running->cancel();  // a third one would only take time
  };
  Densifier densifier(preset(Quality::kOnline), callbacks);
  running = &densifier;
  fly_through(densifier, mission);
  return middle;
}

Accuracy accuracy(const synth::Mission& mission) {
  const DepthMap map = raw_depth_of_middle(mission);
  REQUIRE(map.depth.width() == kWidth);
  const Image<float>& truth = mission.frames[1].depth;
  return {synth::share_within(map.depth, truth, 0.02), synth::share_within(map.depth, truth, 0.02, [&](int x, int y) {
            return degrees_from_motion(mission, 1, x, y) > 15.0;
          })};
}

synth::Recipe full_size() {
  synth::Recipe recipe;
  recipe.keyframes = 3;
  recipe.mission.render.samples = 2;
  return recipe;
}

struct BothWays {
  Accuracy forward;
  Accuracy backward;  ///< the same flight with the camera turned by 180 degrees
};

const BothWays& empty_room() {
  static const BothWays kFound = [] {
    const synth::Mission mission = synth::empty_room(full_size());
    return BothWays{accuracy(mission), accuracy(synth::turned(mission, kWidth / 2))};
  }();
  return kFound;
}

}  // namespace

TEST_CASE("the online preset finds a textured room, whichever way the camera looks", "[densifier]" PMSP_ACCURACY) {
  const Accuracy forward = empty_room().forward;
  const Accuracy backward = empty_room().backward;
  CAPTURE(forward.all, forward.off_axis, backward.all, backward.off_axis);
  CHECK(forward.all >= 0.95);
  CHECK(backward.all >= 0.95);
  CHECK(forward.off_axis >= 0.97);
  CHECK(backward.off_axis >= 0.97);
  CHECK(std::abs(forward.all - backward.all) < 0.005);
}

TEST_CASE("images finer than the depth maps make clouds more accurate", "[densifier]" PMSP_ACCURACY) {
  const synth::Mission mission = synth::textured_room(small_recipe(640, 5));
  const auto good = [&](double image_scale) {
    DensifierOptions options = fast_options(320);
    options.advanced.patchmatch.image_scale = image_scale;
    return points_on_surface(mission.scene, densify(mission, options).clouds, 0.002);
  };
  const double coarse = good(1.0);
  const double fine = good(2.0);
  CAPTURE(coarse, fine);
  CHECK(fine > coarse + 0.02);
}

TEST_CASE("away from the direction of motion 98 % of the room is found", "[densifier]" PMSP_ACCURACY) {
  CHECK(empty_room().forward.off_axis >= 0.98);
  CHECK(empty_room().backward.off_axis >= 0.98);
}

TEST_CASE("the online preset finds a furnished room", "[densifier]" PMSP_ACCURACY) {
  const Accuracy found = accuracy(synth::textured_room(full_size()));
  CAPTURE(found.all, found.off_axis);
  CHECK(found.all >= 0.90);
  CHECK(found.off_axis >= 0.93);
}

TEST_CASE("the sky gives no points cloudy or overexposed while houses and lawn do", "[densifier]" PMSP_ACCURACY) {
  const bool is_overexposed = GENERATE(false, true);
  synth::Recipe recipe;
  recipe.width = 384;
  recipe.height = 192;
  recipe.keyframes = 6;
  recipe.overexposed_sky = is_overexposed;
  recipe.mission.render.samples = 2;
  recipe.mission.render.noise_sigma = 1.0;
  const synth::Mission mission = synth::yard(recipe);
  Recording recording;
  DensifierOptions options = preset(Quality::kOnline);
  options.width = recipe.width;
  options.height = recipe.height;
  Densifier densifier(options, recording.callbacks());
  fly_through(densifier, mission);
  std::int64_t sky = 0;
  std::int64_t floating = 0;
  double found = 0.0;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    const synth::Frame& frame = mission.frames[i];
    const Image<float>& depth = recording.filtered[i].depth;
    for (std::size_t k = 0; k < depth.size(); ++k) {
      const bool is_sky = frame.label.pixels()[k] == static_cast<std::uint8_t>(synth::Label::kSky);
      sky += is_sky ? 1 : 0;
      floating += is_sky && depth.pixels()[k] > 0.0F ? 1 : 0;
    }
    const auto is_near = [&](int x, int y) { return frame.depth(x, y) < 12.0F; };
    found += synth::share_within(depth, frame.depth, 0.05, is_near) / static_cast<double>(mission.frames.size());
  }
  CAPTURE(is_overexposed, sky, floating, found, densifier.stats().pixels_far);
  CHECK(floating < sky / 20);
  CHECK(densifier.stats().pixels_far > sky * 4 / 5);
  CHECK(densifier.stats().pixels_far < sky * 5 / 4);  // and what lies beyond all landmarks
  CHECK(found > 0.8);
}
