// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp {

/// Returns the unit bearing (x right, y down, z forward) of a point in an equirectangular image. `pixel` counts from
/// the upper left corner, so that pixel (i, j) has its centre at (i + 0.5, j + 0.5); x wraps, y does not.
PMSP_API Eigen::Vector3d bearing_from_pixel(const Eigen::Vector2d& pixel, int width, int height);

/// Returns the image point, in [0, width) x [0, height], of a direction of any length > 0.
PMSP_API Eigen::Vector2d pixel_from_bearing(const Eigen::Vector3d& direction, int width, int height);

/// Returns the correction for poses of OpenVSLAM and stella_vslam, whose pixel centres are at whole numbers: a rotation
/// about the y axis by pi / width.
///     keyframe.cam_from_world = cam_from_slam_cam(image_width) * rigid_transform(slam_pose_cw).
PMSP_API RigidTransform cam_from_slam_cam(int image_width);

/// Converts a 4x4 pose matrix; its bottom row is ignored.
inline RigidTransform rigid_transform(const Eigen::Ref<const Eigen::Matrix4d>& matrix) {
  return {matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()};
}
inline RigidTransform rigid_transform(const Eigen::Isometry3d& pose) { return {pose.linear(), pose.translation()}; }

}  // namespace pmsp
