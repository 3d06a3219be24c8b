// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/cloud_writer.h"
#include "pmsp/io/similarity.h"

namespace pmsp {

/// What a cloud says of itself before its points.
struct CloudInfo {
  std::string format;       ///< "PLY", "LAS", "Potree", "COLMAP", "workspace"
  std::int64_t points = 0;  ///< announced
  bool has_normals = false, has_colors = false, has_confidence = false, has_views = false;
  bool double_positions = false;            ///< PLY
  std::vector<std::string> comments;        ///< how it was made, a line each
  std::optional<Similarity> file_from_map;  ///< nullopt where the cloud does not say so: another program made it
  CloudUnit unit;
  std::string wkt;                ///< coordinate reference system; "" = none
  int year = 0, day_of_year = 0;  ///< of the data; 0 = not known
};

/// The points of a cloud, in memory that does not grow with it.
class PMSP_API CloudReader {
 public:
  /// Points in the frame and unit of the cloud. What the cloud lacks is 0, a missing colour grey (200). Confidences lie
  /// between 0 and 1. Keyframe and pixel are those of a workspace; elsewhere they number the points.
  using Take = std::function<void(const OutputPoint* points, std::size_t count)>;

  virtual ~CloudReader() = default;
  const CloudInfo& info() const { return info_; }

  /// Delivers all points, some at a time, in their order in the file. May be called several times. Throws IoError,
  /// InvalidInput where the data are cut off or a position is not finite.
  virtual void read(const Take& take) = 0;

 protected:
  CloudInfo info_;
};

/// A PLY (ascii, or binary of either byte order), a LAS 1.0 to 1.4 or a Potree 2 folder that is not compressed, the
/// points of a dataset (COLMAP, nerfstudio), or a workspace, by its content. Throws IoError, InvalidInput: none of
/// these, or broken.
PMSP_API std::unique_ptr<CloudReader> open_cloud(const std::filesystem::path& path);

/// Box around all points; nullopt = there are none. Reads them all.
PMSP_API std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bounds_of(CloudReader& cloud);

/// `file_from_map` and `unit` from the comments that pmsp-densify writes, and what these say that the cloud lacks.
PMSP_API void read_origin(CloudInfo& info);

}  // namespace pmsp
