// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>

#include "pmsp/image.h"

namespace pmsp::io {

/// A folder of depth images. Those that --depth-maps has written are found by keyframe id, as its index.json tells;
/// others by the name of the keyframe's image: "a/7.jpg" has "a/7.pfm", "a/7.exr", "a/7.npy" or "a/7.png".
class DepthFolder {
 public:
  /// `images`: the folder that images lie in. Throws IoError where there is no such folder; InvalidInput where its
  /// index is broken, or names files that lie elsewhere.
  DepthFolder(const std::filesystem::path& folder, const std::filesystem::path& images);

  /// Whether there is an index.
  bool is_indexed() const { return indexed_; }

  /// Empty where there is none.
  std::filesystem::path file_for(std::int64_t keyframe_id, const std::filesystem::path& image) const;

  /// Depths, or other values; 0 = none. PNGs count in the unit that the index tells, others' in gray levels. Throws
  /// IoError, InvalidInput.
  Image<float> read(const std::filesystem::path& file) const;

  double png_scale() const { return png_scale_; }

 private:
  std::filesystem::path folder_, images_;
  bool indexed_ = false;
  double png_scale_ = 1.0;
  std::map<std::int64_t, std::filesystem::path> files_;  ///< by keyframe, of the index
};

}  // namespace pmsp::io
