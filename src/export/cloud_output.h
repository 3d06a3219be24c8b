// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "export/placed_points.h"
#include "export/thinning.h"
#include "pmsp/io/cloud_writer.h"

namespace pmsp {

/// A box, its faces included.
struct Box {
  Eigen::Vector3d low, high;
  bool contains(const Eigen::Vector3d& x) const {
    return (x.array() >= low.array()).all() && (x.array() <= high.array()).all();
  }
};

/// How much of a cloud is written.
struct CloudAmount {
  std::optional<Box> crop;  ///< in the frame of the file
  ThinningOptions thinning;
};

/// A mission's points on their way into files: placed in the frame of the files, cropped, thinned, written in each of
/// the formats. Memory does not grow with the cloud.
class CloudOutput {
 public:
  struct Target {
    const CloudFormat* format;
    std::filesystem::path path;
  };

  /// Throws OutputError when a target cannot be made.
  CloudOutput(const CloudHeader& header, const CloudAmount& amount, const std::vector<Target>& targets, int threads);
  ~CloudOutput();

  /// Gives it, too, all points that are written; finishing it is left to whom it belongs. Before the first point.
  void also_to(CloudWriter& writer) { others_.push_back(&writer); }

  void add(const KeyframeCloud& cloud);
  /// Points that have come.
  std::int64_t points_in() const { return points_in_; }

  /// After the last point: what was held back for thinning goes to the writers.
  void complete();
  /// Points written, once it is complete.
  std::int64_t points() const { return points_; }

  /// Puts the files in their places. Throws OutputError.
  void commit();

 private:
  void write(const OutputPoint* points, std::size_t count);

  Similarity file_from_map_;
  std::optional<Box> crop_;
  std::vector<std::unique_ptr<CloudWriter>> writers_;
  std::vector<CloudWriter*> others_;
  std::unique_ptr<Thinning> thinning_;  ///< nullptr = none
  PlacedPoints placed_;
  std::int64_t points_in_ = 0, points_ = 0;
};

}  // namespace pmsp
