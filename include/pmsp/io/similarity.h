// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

#include "pmsp/transform.h"

namespace pmsp {

/// x_target = scale * rotation * x_source + translation, named `target_from_source` like a RigidTransform.
struct Similarity {
  double scale = 1.0;                                      ///< > 0
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< orthonormal, determinant +1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< in the unit of the target

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }

  /// target_from_middle * middle_from_source = target_from_source.
  Similarity operator*(const Similarity& other) const {
    return {scale * other.scale, rotation * other.rotation, *this * other.translation};
  }

  /// A camera pose moved along: its centre by the similarity, its axes by the rotation.
  RigidTransform operator*(const RigidTransform& world_from_cam) const {
    return {rotation * world_from_cam.rotation, *this * world_from_cam.translation};
  }

  bool is_identity() const {
    return scale == 1.0 && rotation == Eigen::Matrix3d::Identity() && translation == Eigen::Vector3d::Zero();
  }
};

}  // namespace pmsp
