// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "export/thinning.h"
#include "pmsp/io/cloud_writer.h"
#include "pmsp/io/files.h"

namespace pmsp {

/// A folder that a writer makes. If it is empty in the end, it goes again.
class MadeFolder {
 public:
  /// Throws OutputError.
  explicit MadeFolder(std::filesystem::path path) : path_(std::move(path)) { make_folder(path_); }
  ~MadeFolder() {
    std::error_code ignored;
    if (std::filesystem::is_empty(path_, ignored) && !ignored) std::filesystem::remove(path_, ignored);
  }
  MadeFolder(const MadeFolder&) = delete;
  MadeFolder& operator=(const MadeFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const char* name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// What all datasets for trainers have in common: a folder, images in it, and a share of the points.
class DatasetFolder {
 public:
  DatasetFolder(const std::filesystem::path& path, const CloudHeader& header)
      : folder_(path), header_(header), thinning_({0.0, header.dataset_points}, header.scratch.string()) {}

  const MadeFolder& folder() const { return folder_; }
  const CloudHeader& header() const { return header_; }
  void add(const OutputPoint* points, std::size_t count) { thinning_.add(points, count); }

  /// After the last point, once.
  void finish(const Thinning::Take& take) { thinning_.finish(take); }
  std::vector<OutputView> put_images() const {
    make_folder(folder_ / "images");
    return header_.export_views ? header_.export_views(folder_.path()) : std::vector<OutputView>{};
  }

 private:
  MadeFolder folder_;
  CloudHeader header_;
  Thinning thinning_;
};

}  // namespace pmsp
