// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "live/live_tracker.h"

using namespace pmsp;

namespace {

constexpr std::size_t kKeyframes = 12;

/// A flight along x whose steps differ in length by up to twice `uneven`. Each keyframe sees landmarks of its own.
std::vector<LiveKeyframe> flight(double uneven) {
  std::vector<LiveKeyframe> keyframes(kKeyframes);
  for (std::size_t k = 0; k < kKeyframes; ++k) {
    const double at = static_cast<double>(k);
    const Eigen::Vector3d center(0.3 * at + uneven * std::sin(2.4 * at), 0.0, 0.0);
    keyframes[k].id = static_cast<std::int64_t>(k);
    keyframes[k].cam_from_world.translation = -center;
    for (std::int64_t id = 0; id < 40; ++id) {
      const double angle = 0.5 * static_cast<double>(id);
      keyframes[k].landmarks.push_back(
          {40 * keyframes[k].id + id, center + Eigen::Vector3d(2.0, 3.0 * std::cos(angle), 3.0 * std::sin(angle))});
    }
  }
  return keyframes;
}

}  // namespace

TEST_CASE("A scale change is recovered after any earlier rigid motion", "[live]") {
  LiveTracker tracker;
  for (const LiveKeyframe& keyframe : flight(0.0)) tracker.add(keyframe, static_cast<std::uint64_t>(keyframe.id) + 1);
  std::vector<LiveKeyframe> keyframes = flight(0.1);  // a bundle adjustment: some baselines get longer, others shorter
  tracker.move(keyframes);
  for (const LiveKeyframe& keyframe : keyframes) {
    CAPTURE(keyframe.id);
    CHECK(tracker.pose_of(keyframe.id).pose.scale == 1.0);
  }
  constexpr double kUnit = 0.8;  // a loop closure
  for (LiveKeyframe& keyframe : keyframes) {
    keyframe.cam_from_world.translation *= kUnit;
    keyframe.landmarks.clear();
  }
  tracker.move(keyframes);
  for (const LiveKeyframe& keyframe : keyframes) {
    CAPTURE(keyframe.id);
    CHECK(tracker.pose_of(keyframe.id).pose.scale == Approx(kUnit).epsilon(1e-6));
  }
}

TEST_CASE("Small scale changes accumulate also after merged maps", "[live]") {
  LiveTracker tracker;
  std::vector<LiveKeyframe> keyframes = flight(0.0);
  for (LiveKeyframe& keyframe : keyframes) {
    keyframe.map_id = keyframe.id < 6 ? 0 : 1;
    tracker.add(keyframe, static_cast<std::uint64_t>(keyframe.id) + 1);
  }
  for (LiveKeyframe& keyframe : keyframes) keyframe.map_id = 0;
  tracker.move(keyframes);
  double unit = 1.0;
  for (int step = 0; step < 10; ++step) {  // each less than what counts as a change
    unit *= 0.998;
    for (LiveKeyframe& keyframe : keyframes) {
      keyframe.cam_from_world.translation *= 0.998;
      keyframe.landmarks.clear();
    }
    tracker.move(keyframes);
  }
  for (std::size_t k = 4; k < 8; ++k) {  // in the middle, with the most baselines
    CAPTURE(k);
    CHECK(tracker.pose_of(keyframes[k].id).pose.scale == Approx(unit).margin(0.008));
  }
}

TEST_CASE("Landmarks of an unmoved keyframe determine its scale", "[live]") {
  LiveTracker tracker;
  std::vector<LiveKeyframe> keyframes = flight(0.0);
  for (const LiveKeyframe& keyframe : keyframes) tracker.add(keyframe, static_cast<std::uint64_t>(keyframe.id) + 1);
  const auto shrink = [&](double unit, double shift) {  // about keyframe 4, which stays where it is
    const std::vector<LiveKeyframe> all = flight(0.0);
    const Eigen::Vector3d fixed = all[4].cam_from_world.center();
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      keyframes[k] = all[k];
      const Eigen::Vector3d center = fixed + unit * (all[k].cam_from_world.center() - fixed);
      keyframes[k].cam_from_world.translation =
          -(all[k].cam_from_world.rotation * (center + Eigen::Vector3d(0.0, shift, 0.0)));
      if (k == 4 && shift == 0.0) keyframes[k].cam_from_world = all[k].cam_from_world;
      for (Landmark& landmark : keyframes[k].landmarks) {
        landmark.position_world = fixed + unit * (landmark.position_world - fixed);
      }
    }
  };
  constexpr double kUnit = 0.8;
  shrink(kUnit, 0.0);
  tracker.move(keyframes);
  for (std::int64_t id = 0; id < static_cast<std::int64_t>(kKeyframes); ++id) {
    if (id != 4 && id != 5) tracker.erase(id);
  }
  shrink(kUnit, 1e-6);
  tracker.move({keyframes[4], keyframes[5]});  // too few for baselines
  for (const std::int64_t id : {4, 5}) {
    CAPTURE(id);
    CHECK(tracker.pose_of(id).pose.scale == Approx(kUnit).epsilon(1e-3));
  }
}

TEST_CASE("Landmark ranges are scaled by the scale recovered from baselines", "[live]") {
  LiveTracker tracker;
  for (const LiveKeyframe& keyframe : flight(0.0)) tracker.add(keyframe, static_cast<std::uint64_t>(keyframe.id) + 1);
  constexpr double kUnit = 0.8;
  std::vector<LiveKeyframe> keyframes = flight(0.0);
  for (LiveKeyframe& keyframe : keyframes) {
    keyframe.cam_from_world.translation *= kUnit;
    keyframe.landmarks.clear();  // not passed this time
  }
  tracker.move(keyframes);
  for (std::int64_t id = 0; id < static_cast<std::int64_t>(kKeyframes); ++id) {
    if (id != 4 && id != 5) tracker.erase(id);
  }
  const std::vector<LiveKeyframe> all = flight(0.0);
  keyframes = {all[4], all[5]};  // too few for baselines
  for (LiveKeyframe& keyframe : keyframes) {
    keyframe.cam_from_world.translation *= kUnit;
    keyframe.cam_from_world.translation.y() += 1e-6;
    for (Landmark& landmark : keyframe.landmarks) landmark.position_world *= kUnit;
  }
  tracker.move(keyframes);
  for (const LiveKeyframe& keyframe : keyframes) {
    CAPTURE(keyframe.id);
    CHECK(tracker.pose_of(keyframe.id).pose.scale == Approx(kUnit).epsilon(1e-3));
  }
}
