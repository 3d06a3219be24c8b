// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::eval {

struct TimedPose {
  std::int64_t id = 0;     ///< of the keyframe in its map; in a TUM file the number of the pose, from 0
  double timestamp = 0.0;  ///< [s]
  RigidTransform world_from_cam;
};

/// A TUM trajectory: lines `timestamp tx ty tz qx qy qz qw`, camera to world; empty lines and lines that begin with #
/// are skipped. Order is kept. Throws IoError, or InvalidInput naming path and line.
std::vector<TimedPose> read_tum(const std::filesystem::path& path);

/// Throws OutputError.
void write_tum(const std::filesystem::path& path, const std::vector<TimedPose>& trajectory);

/// The keyframes of a map, in the order of their ids.
std::vector<TimedPose> trajectory_of(const SlamMap& map);

}  // namespace pmsp::eval
