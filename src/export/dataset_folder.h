// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <system_error>
#include <vector>

#include "export/atomic_folder.h"
#include "export/dataset_depth.h"
#include "export/files.h"
#include "export/thinning.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

/// Common part of datasets for trainers: a folder with images and a subset of the points.
class DatasetFolder {
 public:
  DatasetFolder(const std::filesystem::path& path, AtomicFolder::IsOwn is_own, const CloudHeader& header)
      : folder_(path, is_own), header_(header), thinning_({0.0, header.dataset_points}, header.scratch.string()) {
    if (header.dataset_depth.is_wanted()) {
      depth_.emplace(folder_.path(), header.dataset_depth, header.file_from_map.scale);
    }
  }

  const AtomicFolder& folder() const { return folder_; }
  const CloudHeader& header() const { return header_; }
  void add(const OutputPoint* points, std::size_t count) { thinning_.add(points, count); }

  /// To be called once, after the last point.
  void finish(const Thinning::Take& take) { thinning_.finish(take); }
  void add_depth(const DepthMap& map) {
    if (depth_) depth_->add(map);
  }
  bool wants_depth() const { return depth_.has_value(); }

  /// Images, masks and depth images, after the last point and depth map.
  std::vector<OutputView> put_images() {
    make_folder(folder_ / "images");
    std::vector<OutputView> views =
        header_.export_views ? header_.export_views(folder_.path()) : std::vector<OutputView>{};
    if (depth_) depth_->finish(views);
    return views;
  }
  /// nullptr = none.
  const DatasetDepthFiles* depth() const { return depth_ && depth_->is_there() ? &*depth_ : nullptr; }

  /// To be called after all files are written.
  void commit(const std::vector<OutputView>& views) {
    folder_.commit();
    const std::filesystem::path masks = folder_.target() / "masks";
    std::error_code ignored;
    for (const OutputView& view : views) {  // stale masks of an earlier run
      if (!view.has_mask) std::filesystem::remove(masks / (view.name + ".png"), ignored);
    }
    if (std::filesystem::is_empty(masks, ignored)) std::filesystem::remove(masks, ignored);
    DatasetDepthFiles::remove_stale(folder_.target(), views, depth());
  }

 private:
  AtomicFolder folder_;
  CloudHeader header_;
  Thinning thinning_;
  std::optional<DatasetDepthFiles> depth_;
};

}  // namespace pmsp
