// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "pmsp/types.h"

namespace pmsp::eval {

struct TimedPose {
  std::int64_t id = 0;     ///< keyframe id in the map; in trajectories the index of the pose, from 0
  double timestamp = 0.0;  ///< [s]
  RigidTransform world_from_cam;
};

/// Returns the keyframes of a map or trajectory, as read_map. Throws IoError, InvalidInput.
std::vector<TimedPose> read_trajectory(const std::filesystem::path& path);

/// Throws OutputError.
void write_tum(const std::filesystem::path& path, const std::vector<TimedPose>& trajectory);

}  // namespace pmsp::eval
