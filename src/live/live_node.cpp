// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_node.h"

#include <algorithm>

#include "equirect.h"

namespace pmsp {
namespace {

/// The rotation times the ratio of the scales, and the translation in the other one's unit.
RigidTransform other_from_own(const KeyframePose& other, const KeyframePose& own) {
  RigidTransform transform = other.cam_from_world * own.cam_from_world.inverse();
  transform.rotation *= own.scale / other.scale;
  transform.translation /= other.scale;
  return transform;
}

}  // namespace

double moved_px(const LiveInput& then, const KeyframePose& other, const KeyframePose& own, double range, int width) {
  const RigidTransform before = other_from_own(then.other, then.own);
  const RigidTransform after = other_from_own(other, own);
  const double zoom = then.own.scale / then.other.scale;
  const double turned = (after.rotation - before.rotation).norm() / (std::sqrt(2.0) * zoom);
  const double shifted = range > 0.0 ? (after.translation - before.translation).norm() / (range * zoom) : 0.0;
  return (turned + shifted) * width / (2.0 * kernels::kPi);
}

Keyframe LiveNode::keyframe() const {
  Keyframe keyframe;
  keyframe.id = id;
  keyframe.cam_from_world = pose.cam_from_world;
  keyframe.scale = pose.scale;
  keyframe.landmarks = seen;
  const RigidTransform world_from_cam = pose.cam_from_world.inverse();
  for (Landmark& landmark : keyframe.landmarks) {
    landmark.position_world = world_from_cam * (pose.scale * landmark.position_world);
  }
  return keyframe;
}

void LiveNode::take_landmarks(const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world) {
  seen = landmarks;
  std::vector<double> ranges;
  ranges.reserve(seen.size());
  for (Landmark& landmark : seen) {
    landmark.position_world = (cam_from_world * landmark.position_world) / pose.scale;
    ranges.push_back(landmark.position_world.norm());
  }
  range = 0.0;
  if (ranges.empty()) return;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
  std::nth_element(ranges.begin(), middle, ranges.end());
  range = *middle;
}

}  // namespace pmsp
