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

struct TruthOptions {
  double fps = 10.0;       ///< rate that the numbers of frames count in [1/s]
  double png_scale = 0.0;  ///< length of a gray level of range/<frame>.png [m]; 0 = not set
  /// True poses, whose ids are the numbers of the frames; null = those of traj_tum.txt. Only used by the constructor.
  const std::vector<TimedPose>* poses = nullptr;
};

/// Folder of ground truth:
///   traj_tum.txt          true poses, camera to world [m]
///   range_mm/<frame>.png  16-bit gray, distance along the ray through the pixel centre [mm], 0, 65535 = no surface; or
///   range/<frame>.*       the same in metres: .pfm, .exr, .npy, or .png of another scale
///   cloud.ply, cloud.las  scanned points [m], beside or instead of range maps
///   normal/<frame>.*      optional: unit normals in the world of the poses: .exr with channels X, Y, Z, .pfm, .png
///   label/<frame>.png     16-bit gray, optional: class of each pixel, see Label in label_measures.h
/// Images are equirectangular and named by the number of their frame, which may be followed by _ and other text; the
/// time of frame f is f / fps seconds.
class GroundTruth {
 public:
  struct RangeMap {
    std::int64_t frame = 0;
    int row = 0;  ///< index of its pose in `trajectory()`
    std::filesystem::path path;
    double gray_m = 0.0;           ///< length of a gray level [m]; 0 = unknown
    std::filesystem::path normal;  ///< normals of the same frame; "" = none
    std::filesystem::path label;   ///< likewise
  };

  /// Lists the folder; images are read by `load`. Throws IoError; InvalidInput without range maps and cloud, for a
  /// range map without pose, or if the trajectory is not ascending in time.
  GroundTruth(const std::filesystem::path& folder, const TruthOptions& options);

  const std::vector<TimedPose>& trajectory() const { return trajectory_; }

  /// Ascending by frame.
  const std::vector<RangeMap>& range_maps() const { return range_maps_; }

  /// Returns the range map of a row of the trajectory; nullptr = none.
  const RangeMap* find(int row) const;

  /// File of scanned points; "" = none.
  const std::filesystem::path& cloud() const { return cloud_; }

  /// Integer metres near the middle of the path; measures are relative to it, for float32 precision.
  const Eigen::Vector3d& origin() const { return origin_; }

  /// Returns the range of each pixel [m]. Throws IoError, InvalidInput.
  static Image<float> load(const RangeMap& map);

  /// Returns the normal of each pixel in the camera's frame, (0, 0, 0) = unknown; empty = none. Throws IoError,
  /// InvalidInput.
  Image<Eigen::Vector3f> load_normals(const RangeMap& map) const;

  /// Returns the label of each pixel; empty = none. Throws IoError, InvalidInput.
  static Image<std::uint8_t> load_labels(const RangeMap& map);

 private:
  void place_by_time(double fps);
  void place_by_id();

  std::vector<TimedPose> trajectory_;
  std::vector<RangeMap> range_maps_;
  std::filesystem::path cloud_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

/// Reads only the true poses of a ground-truth folder, sufficient for an alignment.
std::vector<TimedPose> read_true_trajectory(const std::filesystem::path& folder);

}  // namespace pmsp::eval
