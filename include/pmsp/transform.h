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

/// Whether all numbers are the same, without tolerance.
inline bool operator==(const RigidTransform& a, const RigidTransform& b) {
  return a.rotation == b.rotation && a.translation == b.translation;
}
inline bool operator!=(const RigidTransform& a, const RigidTransform& b) { return !(a == b); }

/// How far a keyframe's unit of length may be from that of the world, either way.
constexpr double kMaxScale = 1e3;

/// Where a keyframe is, and how long its unit of length is in the unit of the world: a point X of its camera frame is
/// at world_from_cam * (scale * X). A loop closure of a monocular SLAM changes both.
struct KeyframePose {
  RigidTransform cam_from_world;  ///< translation in the world's unit
  double scale = 1.0;             ///< 1 / kMaxScale to kMaxScale
};

/// Whether all numbers are the same, without tolerance.
inline bool operator==(const KeyframePose& a, const KeyframePose& b) {
  return a.cam_from_world == b.cam_from_world && a.scale == b.scale;
}
inline bool operator!=(const KeyframePose& a, const KeyframePose& b) { return !(a == b); }

}  // namespace pmsp
