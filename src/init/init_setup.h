// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

#include "init.h"
#include "pmsp/camera.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// Landmarks at usable depths, in the format of the kernels. `to`: storage for all landmarks; returns the number
/// written. `lens`: distance of the forward lens in front of the camera's centre [keyframe's unit].
inline std::size_t sparse_points(const Keyframe& keyframe, double lens, int width, int height,
                                 kernels::SparsePoint* to) {
  std::size_t count = 0;
  for (const Landmark& landmark : keyframe.landmarks) {
    Eigen::Vector3d p = keyframe.cam_from_world * landmark.position_world;
    p.z() -= (p.z() < 0.0 ? -lens : lens) * keyframe.scale;
    if (!is_usable_depth(p.norm() / keyframe.scale)) continue;
    const Eigen::Vector2f at = pixel_from_bearing(p, width, height).cast<float>();
    const Eigen::Vector3f plane = (keyframe.scale / p.squaredNorm() * p).cast<float>();
    to[count++] = {at.x(), at.y(), {plane.x(), plane.y(), plane.z()}};
  }
  return count;
}

}  // namespace pmsp
