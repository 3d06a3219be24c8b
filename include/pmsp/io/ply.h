// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/point_cloud.h"

namespace pmsp {

/// Writes a binary little-endian PLY point by point, so that a cloud never needs to be in memory as a whole. Layout of
/// a vertex: x y z (float, or double), nx ny nz (float), red green blue (uchar), scalar_confidence (float),
/// scalar_views (uchar): names that CloudCompare takes as scalar fields. Points go to a file beside the target, which
/// `finish` renames; a writer that is destroyed before leaves no trace. Where the file system can do it (O_TMPFILE),
/// that file has no name, so that not even a killed process leaves one.
class PlyWriter {
 public:
  struct Options {
    bool double_positions = false;      ///< x y z as double
    std::vector<std::string> comments;  ///< line breaks become spaces; of more than 200 letters several lines are made
  };

  /// Throws OutputError when the file cannot be made.
  PlyWriter(const std::filesystem::path& path, const Options& options);
  ~PlyWriter();

  /// Appends the points in world coordinates with the keyframe at `pose`: the cloud's own one, or a newer one. Throws
  /// OutputError (disk full).
  void add(const KeyframeCloud& cloud, const KeyframePose& pose);
  void add(const KeyframeCloud& cloud) { add(cloud, cloud.pose()); }

  std::int64_t points() const;

  /// Completes the header and puts the file in its place. Throws OutputError.
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What a PLY holds, as columns. Missing columns are empty. Colours given as numbers from 0 to 1 are scaled to 255;
/// comment lines without words are left out. Confidence and views are taken with or without "scalar_" before the name.
struct PlyCloud {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Rgb> colors;
  std::vector<float> confidence;
  std::vector<std::uint8_t> views;
  std::vector<std::string> comments;
};

/// Reads the vertices of a PLY, ascii or binary of either byte order; other elements are passed over. Throws IoError,
/// or InvalidInput with the line or byte: broken or cut off, no x y z, a position that is not finite.
PlyCloud read_ply(const std::filesystem::path& path);

}  // namespace pmsp
