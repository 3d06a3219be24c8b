// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::map_detail {

/// Alternative convention of a file's poses.
struct PoseConvention {
  std::string what;        ///< description for messages
  bool inverted = false;   ///< world_from_cam and cam_from_world swapped
  Eigen::Matrix3d camera;  ///< camera axes; may mirror
  bool w_first = false;    ///< quaternion of world_from_cam has w first, but was read as qx qy qz qw
  std::string remedy{};    ///< "" = conversion of the file

  RigidTransform of(const RigidTransform& cam_from_world) const;
};

/// All conventions except that of the readers.
std::vector<PoseConvention> other_conventions();

/// Returns the remedy: "put that right where the file was written, ...", or another one.
std::string remedy_of(const PoseConvention& convention);

}  // namespace pmsp::map_detail
