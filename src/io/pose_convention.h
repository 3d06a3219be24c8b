// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::map_detail {

/// Another convention for the poses in a file, by which the file may be meant.
struct PoseConvention {
  std::string what;        ///< for people
  bool inverted = false;   ///< world_from_cam and cam_from_world are swapped
  Eigen::Matrix3d camera;  ///< axes of the camera; may mirror
  bool w_first = false;    ///< of the quaternion of world_from_cam, which was read as qx qy qz qw
  std::string remedy{};    ///< "" = the conversion of the file

  RigidTransform of(const RigidTransform& cam_from_world) const;
};

/// All but the one that the readers have.
std::vector<PoseConvention> other_conventions();

/// "put that right where the file was written, a cloud of it would be wrong", or what else helps.
std::string remedy_of(const PoseConvention& convention);

}  // namespace pmsp::map_detail
