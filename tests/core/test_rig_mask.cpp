// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>

#include "core/recording.h"
#include "elementary.h"
#include "pmsp/calibration.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

using MakeMission = synth::Mission (*)(const synth::Recipe&);

synth::Mission mission(MakeMission make, bool rider, int keyframes = 10) {
  synth::Recipe recipe;
  recipe.keyframes = keyframes;
  recipe.width = 512;
  recipe.height = 256;
  recipe.mission.render.samples = 1;
  recipe.rider = rider;
  return make(recipe);
}

RigMask estimated_mask(const synth::Mission& mission, int threads = 2) {
  const Executor executor(threads);
  RigMaskEstimator estimator;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) estimator.add(keyframe_of(mission, i), executor);
  return estimator.estimate(executor);
}

/// Masked shares of the rider's and of all other directions.
struct Hidden {
  double rider = 0.0, others = 0.0;
};

Hidden hidden_by(const RigMask& rig, const Image<std::uint8_t>& label) {
  Hidden hidden, all;
  for (int y = 0; y < label.height(); ++y) {
    const double weight = std::cos((0.5 - (y + 0.5) / label.height()) * kernels::kPi);
    for (int x = 0; x < label.width(); ++x) {
      const bool is_rider = label(x, y) == static_cast<std::uint8_t>(synth::Label::kRider);
      const bool is_hidden =
          rig.mask(x * rig.mask.width() / label.width(), y * rig.mask.height() / label.height()) == 0;
      (is_rider ? all.rider : all.others) += weight;
      if (is_hidden) (is_rider ? hidden.rider : hidden.others) += weight;
    }
  }
  return {hidden.rider / all.rider, hidden.others / all.others};
}

}  // namespace

TEST_CASE("The rig mask covers the rig and hardly anything else", PMSP_ACCURACY) {
  for (const MakeMission make : {&synth::textured_room, &synth::yard}) {
    const synth::Mission with_rider = mission(make, true);
    const RigMask rig = estimated_mask(with_rider);
    REQUIRE(rig.mask.width() == RigMaskEstimator::kWidth);
    const Hidden hidden = hidden_by(rig, with_rider.frames.front().label);
    CAPTURE(rig.share, hidden.rider, hidden.others);
    CHECK(hidden.rider > 0.9);
    CHECK(hidden.others < 0.06);
    CHECK(estimated_mask(with_rider, 1).mask.pixels() == rig.mask.pixels());
  }
}

TEST_CASE("A camera without a rig has no rig mask", PMSP_ACCURACY) {
  for (const MakeMission make : {&synth::yard, &synth::painted_room, &synth::corridor_across_seam}) {
    CHECK(estimated_mask(mission(make, false)).mask.empty());
  }
}

TEST_CASE("No rig mask without motion or from too few keyframes") {
  CHECK(RigMaskEstimator().estimate(Executor(1)).mask.empty());
  const synth::Mission with_rider = mission(&synth::textured_room, true, 6);
  const Executor executor(2);
  RigMaskEstimator few, resting;
  for (std::size_t i = 0; i < with_rider.frames.size(); ++i) {
    Keyframe keyframe = keyframe_of(with_rider, i);
    if (i > 0) few.add(keyframe, executor);
    keyframe.cam_from_world = with_rider.frames.front().cam_from_world;
    resting.add(keyframe, executor);
  }
  CHECK(few.keyframes() == RigMaskEstimator::kFewestKeyframes - 1);
  CHECK(few.estimate(executor).mask.empty());
  CHECK(resting.estimate(executor).mask.empty());
}

TEST_CASE("Masked pixels are no rig") {
  const synth::Mission with_rider = mission(&synth::textured_room, true);
  const Image<std::uint8_t>& label = with_rider.frames.front().label;
  Image<std::uint8_t> mask(512, 256, 255);
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (label(x * label.width() / 512, y * label.height() / 256) == static_cast<std::uint8_t>(synth::Label::kRider))
        mask(x, y) = 0;
    }
  }
  const Executor executor(2);
  RigMaskEstimator estimator;
  for (std::size_t i = 0; i < with_rider.frames.size(); ++i) {
    Keyframe keyframe = keyframe_of(with_rider, i);
    keyframe.mask = static_cast<const Image<std::uint8_t>&>(mask).view();
    estimator.add(keyframe, executor);
  }
  CHECK(estimator.estimate(executor).mask.empty());
}
