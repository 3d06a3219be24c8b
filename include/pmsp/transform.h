// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

namespace pmsp {

/// A rotation and a translation, named `target_from_source` wherever it is used: x_target = rotation * x_source +
/// translation. Plain 3x3 matrix and 3-vector on purpose: their alignment does not depend on the compiler flags of the
/// program that links the library, as that of Eigen's quaternions and 4x4 matrices does.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< orthonormal, determinant +1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< [scene units]

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return rotation * x + translation; }

  /// target_from_middle * middle_from_source = target_from_source.
  RigidTransform operator*(const RigidTransform& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }

  RigidTransform inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }

  /// Origin of the target frame seen from the source frame; for `cam_from_world` the camera centre in the world.
  Eigen::Vector3d center() const { return -(rotation.transpose() * translation); }
};

}  // namespace pmsp
