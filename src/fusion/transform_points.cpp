// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/types.h"

namespace pmsp {

std::vector<CloudPoint> transform_points(const KeyframeCloud& cloud, const KeyframePose& pose) {
  const RigidTransform world_from_cam = pose.cam_from_world.inverse();
  std::vector<CloudPoint> points = cloud.points;
  for (CloudPoint& point : points) {
    point.position = (world_from_cam * (pose.scale * point.position.cast<double>())).cast<float>();
    point.normal = (world_from_cam.rotation * point.normal.cast<double>()).cast<float>();
  }
  return points;
}

}  // namespace pmsp
