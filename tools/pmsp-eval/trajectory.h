// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::eval {

struct TimedPose {
  std::int64_t id = 0;     ///< keyframe id in the map; in TUM files the index of the pose, from 0
  double timestamp = 0.0;  ///< [s]
  RigidTransform world_from_cam;
};

/// Reads a TUM trajectory: lines `timestamp tx ty tz qx qy qz qw`, camera to world, in order; empty lines and #
/// comments are skipped. Throws IoError; InvalidInput with path and line.
std::vector<TimedPose> read_tum(const std::filesystem::path& path);

/// Throws OutputError.
void write_tum(const std::filesystem::path& path, const std::vector<TimedPose>& trajectory);

/// Returns the keyframes of a map, by id.
std::vector<TimedPose> trajectory_of(const SlamMap& map);

}  // namespace pmsp::eval
