// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/trajectory.h"
#include "pmsp/types.h"

namespace pmsp::eval {

/// True for valid ranges [m]: 0, infinity and NaN mean "no surface".
inline bool is_range(float range) { return range > 1e-3F && range < 1e4F; }

/// Folder of ground truth:
///   traj_tum.txt        true poses, camera to world [m]
///   range_mm/%06d.png   16-bit gray, distance along the ray through the pixel centre [mm], 0 = no surface; or
///   range/%06d.pfm      the same in metres
///   label/%06d.png      16-bit gray, optional: class of each pixel, see Label in label_measures.h
/// Range maps are equirectangular and named by frame index; the time of frame f is f / fps seconds.
class GroundTruth {
 public:
  struct RangeMap {
    std::int64_t frame = 0;
    int row = 0;  ///< index of its pose in `trajectory()`
    std::filesystem::path path;
  };

  /// Lists the folder; images are read by `load`. Throws IoError; InvalidInput without range maps, for a range map
  /// without pose, or if the trajectory is not ascending in time.
  GroundTruth(const std::filesystem::path& folder, double fps);

  const std::vector<TimedPose>& trajectory() const { return trajectory_; }

  /// Ascending by frame.
  const std::vector<RangeMap>& range_maps() const { return range_maps_; }

  /// Returns the range map of a row of the trajectory; nullptr = none.
  const RangeMap* find(int row) const;

  /// Integer metres near the middle of the path; measures are relative to it, for float32 precision.
  const Eigen::Vector3d& origin() const { return origin_; }

  /// Returns the range of each pixel [m]. Throws IoError, InvalidInput.
  static Image<float> load(const RangeMap& map);

  /// Returns the label of each pixel; empty = none. Throws IoError, InvalidInput.
  static Image<std::uint8_t> load_labels(const RangeMap& map);

 private:
  std::vector<TimedPose> trajectory_;
  std::vector<RangeMap> range_maps_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

/// Reads only the true poses of a ground-truth folder, sufficient for an alignment.
std::vector<TimedPose> read_true_trajectory(const std::filesystem::path& folder);

}  // namespace pmsp::eval
