// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "pmsp/io/cloud_writer.h"
#include "pmsp/options.h"

namespace pmsp {

struct SlamMap;  // pmsp/io/map.h

/// A box, its faces included.
struct Box {
  Eigen::Vector3d low, high;
  bool contains(const Eigen::Vector3d& x) const {
    return (x.array() >= low.array()).all() && (x.array() <= high.array()).all();
  }
};

/// Which points stay where there are more than are wanted.
struct ThinningOptions {
  double voxel = 0.0;           ///< side of the cubes of which each keeps one point; 0 = all points stay
  std::int64_t max_points = 0;  ///< at most so many stay; 0 = all

  bool is_needed() const { return voxel > 0.0 || max_points > 0; }
};

/// How much of a cloud is written.
struct CloudAmount {
  std::optional<Box> crop;  ///< in the frame of the file
  ThinningOptions thinning;
};

/// What can be told of a mission's cloud beforehand: `center` and `reach`, from its cameras and landmarks, and the
/// frame of the file. `range_margin`: InitOptions::range_margin of the run.
PMSP_API CloudHeader cloud_header_of(const SlamMap& map, const Similarity& file_from_map = {},
                                     double range_margin = InitOptions().range_margin);

/// A mission's points on their way into files: placed in the frame of the files, cropped, thinned, written in each of
/// the formats. Memory does not grow with the cloud. Files appear when `commit` is called, whole, or not at all.
class PMSP_API CloudOutput {
 public:
  /// A file or folder to write.
  struct Target {
    const CloudFormat* format;
    std::filesystem::path path;
  };

  /// Throws OutputError when a target cannot be made.
  CloudOutput(const CloudHeader& header, const CloudAmount& amount, const std::vector<Target>& targets);
  /// All points in one file or folder. Its format follows from the extension, see cloud_formats; without one it is a
  /// PLY. Throws InvalidOption where no format has it; OutputError.
  explicit CloudOutput(const std::filesystem::path& path);
  CloudOutput(const std::filesystem::path& path, const CloudHeader& header);
  ~CloudOutput();

  /// Gives it, too, all points that are written; finishing it is left to whom it belongs. Before the first point.
  void also_to(CloudWriter& writer);

  /// With the keyframe at the cloud's own pose, or at a newer one, from a loop closure or a bundle adjustment. Throws
  /// OutputError (disk full; points that come after `commit`).
  void add(const KeyframeCloud& cloud);
  void add(const KeyframeCloud& cloud, const KeyframePose& pose);
  /// Points that already lie in a frame, which `file_from_points` turns into that of the files.
  void add(const OutputPoint* points, std::size_t count, const Similarity& file_from_points);
  /// Points that have come.
  std::int64_t points_in() const;

  /// After the last point: what was held back for thinning goes to the writers.
  void complete();
  /// Points written; with thinning, once it is complete.
  std::int64_t points() const;

  /// Completes, and puts the files in their places. Throws OutputError.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
