// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp/transform.h"

namespace pmsp::map_detail {

/// Another convention for the poses in a file, by which the file may be meant.
struct PoseConvention {
  const char* what;        ///< for people
  bool inverted;           ///< world_from_cam and cam_from_world are swapped
  Eigen::Matrix3d camera;  ///< axes of the camera; may mirror

  RigidTransform of(const RigidTransform& cam_from_world) const {
    const RigidTransform pose = inverted ? cam_from_world.inverse() : cam_from_world;
    return {camera * pose.rotation, camera * pose.translation};
  }
};

/// All but the one that the readers have.
std::vector<PoseConvention> other_conventions();

}  // namespace pmsp::map_detail
