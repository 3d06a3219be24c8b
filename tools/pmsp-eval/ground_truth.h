// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/trajectory.h"
#include "pmsp/types.h"

namespace pmsp::eval {

/// Whether a range is one [m]: 0, infinity and NaN mean "no surface".
inline bool is_range(float range) { return range > 1e-3F && range < 1e4F; }

/// A folder of ground truth:
///   traj_tum.txt        true poses, camera to world, metres
///   range_mm/%06d.png   16-bit gray, distance along the ray through each pixel's centre [mm], 0 = no surface; or
///   range/%06d.pfm      the same in metres
///   label/%06d.png      16-bit gray, may be missing: what each pixel shows, see Label in label_measures.h
/// Range maps are equirectangular and named by frame index; frame f was taken at f / fps seconds.
class GroundTruth {
 public:
  struct RangeMap {
    std::int64_t frame = 0;
    int row = 0;  ///< of its pose in `trajectory()`
    std::filesystem::path path;
  };

  /// Lists the folder; images are read by `load`. Throws IoError, or InvalidInput when there is no range map, a range
  /// map has no pose in the trajectory, or the trajectory does not ascend in time.
  GroundTruth(const std::filesystem::path& folder, double fps);

  const std::vector<TimedPose>& trajectory() const { return trajectory_; }

  /// Ascending frame.
  const std::vector<RangeMap>& range_maps() const { return range_maps_; }

  /// The range map that was taken at a row of the trajectory; nullptr where there is none.
  const RangeMap* find(int row) const;

  /// Whole metres near the middle of the path; measures work relative to it, so that float32 is precise enough.
  const Eigen::Vector3d& origin() const { return origin_; }

  /// Range of each pixel [m]. Throws IoError, InvalidInput.
  static Image<float> load(const RangeMap& map);

  /// The labels of its pixels; empty where there are none. Throws IoError, InvalidInput.
  static Image<std::uint8_t> load_labels(const RangeMap& map);

 private:
  std::vector<TimedPose> trajectory_;
  std::vector<RangeMap> range_maps_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

/// The true poses of a ground-truth folder only; enough for an alignment.
std::vector<TimedPose> read_true_trajectory(const std::filesystem::path& folder);

}  // namespace pmsp::eval
