// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/image.h"
#include "pmsp/transform.h"

namespace pmsp {

/// One point of a dense cloud.
struct CloudPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< frame and unit as the owner says
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    ///< unit, facing the camera, same frame as `position`
  Rgb color;
  std::uint8_t views = 0;   ///< number of keyframes whose depth maps agree on the point, saturating at 255
  float confidence = 0.0F;  ///< 0 to 1
};

/// The points that one keyframe contributes, in that keyframe's camera frame. Because they stay attached to their
/// keyframe, a loop closure or a bundle adjustment moves them without matching anything again: transform with the new
/// pose (`transform_points`).
struct KeyframeCloud {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added; translation in the world's unit
  std::vector<CloudPoint> points;
  double scale = 1.0;  ///< the unit of `points` in the world's unit, see KeyframePose
  KeyframePose pose() const { return {cam_from_world, scale}; }

  /// Of each point the pixel of the keyframe's depth map that it stands for, row x width + column, ascending. With the
  /// keyframe's id a key that stays the same whatever happens to other points. Empty where nobody knows.
  std::vector<std::uint32_t> pixels;
  /// Of each point: bit k is set where the depth map of keyframe `window_ids[k]` agrees. Empty where nobody knows.
  std::vector<std::uint32_t> agree;
  std::vector<std::int64_t> window_ids;  ///< the other keyframes that the points were joined with, 32 at most
};

/// The cloud's points in world coordinates with the keyframe at `pose`: the cloud's own one, or a newer one from a loop
/// closure or a bundle adjustment. Positions are rounded to single precision.
PMSP_API std::vector<CloudPoint> transform_points(const KeyframeCloud& cloud, const KeyframePose& pose);

}  // namespace pmsp
