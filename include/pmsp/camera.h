// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp {

/// Bearing of a point of an equirectangular image. `pixel` is measured from the upper left corner of the image, so the
/// centre of the pixel with index (i, j) is (i + 0.5, j + 0.5). x may lie outside [0, width): it wraps; y is taken as
/// it is. Returns a unit vector, axes x right, y down, z forward.
PMSP_API Eigen::Vector3d bearing_from_pixel(const Eigen::Vector2d& pixel, int width, int height);

/// The inverse: image point in [0, width) x [0, height] of a direction of any length > 0.
PMSP_API Eigen::Vector2d pixel_from_bearing(const Eigen::Vector3d& direction, int width, int height);

/// OpenVSLAM and stella_vslam put the centre of a pixel at its whole index where this library adds one half. In
/// longitude that is a turn of the camera about its y axis by pi / width, which this function undoes:
///     keyframe.cam_from_world = cam_from_slam_cam(image_width) * rigid_transform(slam_pose_cw).
PMSP_API RigidTransform cam_from_slam_cam(int image_width);

/// A pose as most SLAM systems hold it. The bottom row is ignored.
inline RigidTransform rigid_transform(const Eigen::Ref<const Eigen::Matrix4d>& matrix) {
  return {matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()};
}
inline RigidTransform rigid_transform(const Eigen::Isometry3d& pose) { return {pose.linear(), pose.translation()}; }

}  // namespace pmsp
