// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_node.h"

#include "live/live_image.h"
#include "util/median_of.h"

namespace pmsp {

Keyframe LiveNode::keyframe() const {
  Keyframe keyframe;
  keyframe.id = id;
  keyframe.cam_from_world = pose.cam_from_world;
  keyframe.scale = pose.scale;
  keyframe.pose_error = pose_error;
  keyframe.landmarks = landmarks_cam;
  const RigidTransform world_from_cam = pose.cam_from_world.inverse();
  for (Landmark& landmark : keyframe.landmarks) {
    landmark.position_world = world_from_cam * (pose.scale * landmark.position_world);
  }
  return keyframe;
}

Keyframe LiveNode::keyframe(const Image<std::uint8_t>* mask, Image<Rgb>& converted) const {
  Keyframe result = keyframe();
  result.image = rgb_view(image, converted);
  if (mask != nullptr) result.mask = mask->view();
  // In the map unit at `add`. Later scale changes are corrected where supports surround a surface
  // (kernels/plane_prior.h).
  if (prior_depth) result.prior_depth = prior_depth->view();
  return result;
}

void LiveNode::take_landmarks(const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world) {
  landmarks_cam = landmarks;
  std::vector<double> distances;
  distances.reserve(landmarks_cam.size());
  for (Landmark& landmark : landmarks_cam) {
    landmark.position_world = (cam_from_world * landmark.position_world) / pose.scale;
    distances.push_back(landmark.position_world.norm());
  }
  landmark_distance = distances.empty() ? 0.0 : median(distances);
}

}  // namespace pmsp
