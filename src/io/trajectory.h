// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pmsp/types.h"

namespace pmsp::map_detail {

/// A pose of a trajectory, with NaN where it was lost.
struct TrajectoryPose {
  double timestamp = 0.0;  ///< [s]
  RigidTransform body_from_world;
};

/// A file of poses, one a line.
struct Trajectory {
  std::string format;      ///< for messages
  bool has_times = false;  ///< false: as in KITTI's files, whose lines are frames
  std::vector<TrajectoryPose> poses;
  std::vector<std::string> notes{};  ///< how the file was read, where that could be doubted; messages
};

/// Whether the first line that says anything is a pose, or names the columns of one. `head`: the first bytes of a text
/// file, without a byte order mark.
bool is_trajectory(const std::string& head);

/// Reads poses in the order of the file: TUM ("timestamp tx ty tz qx qy qz qw"), EuRoC and VINS (nanoseconds,
/// quaternions with w first, further columns), KITTI (12 numbers, the upper rows of world_from_body), and tables with a
/// line that names their columns. Throws IoError, InvalidInput with the line.
Trajectory read_trajectory(const std::filesystem::path& path);

/// A timestamp in seconds: those of the size of Unix times in milli-, micro- or nanoseconds are in these.
double seconds(double timestamp);

/// Reads camera_from_body from a text file: 12 or 16 numbers, rows of a matrix, or 7, tx ty tz qx qy qz qw; or from a
/// YAML file with one of Kalibr's T_cam_imu, EuRoC's T_BS or VINS's body_T_cam0, of which the last two are inverted.
/// `note` says which. Throws IoError, InvalidInput.
RigidTransform read_camera_from_body(const std::filesystem::path& path, std::string& note);

}  // namespace pmsp::map_detail
