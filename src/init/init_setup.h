// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

#include "init.h"
#include "pmsp/camera.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// The landmarks that make planes, as the kernels take them. Writes at most as many as there are; returns their number.
/// `lens`: how far in front of the camera's centre its forward lens lies [keyframe's unit].
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
