// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "pmsp/types.h"
#include "rigid.h"
#include "vec3.h"

namespace pmsp {

/// Returns the transform in the kernels' single-precision form.
inline kernels::Rigid to_rigid(const RigidTransform& transform) {
  kernels::Rigid result{};
  for (int i = 0; i < 9; ++i) result.r[i] = static_cast<float>(transform.rotation(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) result.t[i] = static_cast<float>(transform.translation[i]);
  return result;
}

/// Returns the transform from the camera frame and unit of `first` to those of `other`: its rotation is multiplied by
/// the scale of `first` over that of `other`.
inline RigidTransform other_from_first(const KeyframePose& other, const KeyframePose& first) {
  RigidTransform transform = other.cam_from_world * first.cam_from_world.inverse();
  transform.rotation *= first.scale / other.scale;
  transform.translation /= other.scale;
  return transform;
}

/// Relative pose of two keyframes, for kernels.
struct RelativePose {
  kernels::Rigid other_from_first;
  float scale_ratio;  ///< scale of `first` over that of `other`
};
/// `lens`: offset of the forward lens in front of the camera's centre [keyframe's unit].
inline RelativePose relative_pose(const KeyframePose& other, const KeyframePose& first, double lens = 0.0) {
  const RigidTransform transform = other_from_first(other, first);
  RelativePose result{to_rigid(transform), static_cast<float>(first.scale / other.scale)};
  for (int i = 0; i < 3; ++i)
    result.other_from_first.source_lens[i] = static_cast<float>(lens * transform.rotation(i, 2));
  result.other_from_first.target_lens = static_cast<float>(lens);
  return result;
}

inline kernels::Vec3<float> to_vec3(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }
inline Eigen::Vector3f to_eigen(const kernels::Vec3<float>& v) { return {v.x, v.y, v.z}; }

/// Angle between two directions [deg].
inline double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return kernels::angle_between({a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()}) * 180.0 / kernels::kPi;
}

}  // namespace pmsp
