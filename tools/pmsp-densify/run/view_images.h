// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "arguments.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// Encodes a mask as PNG: white = used. `mask`: of that size; empty = all used. Throws OutputError.
std::vector<unsigned char> mask_png(ImageView<const std::uint8_t> mask, int width, int height);

/// Images of a mission for datasets, with masks: copies of files, or frames of the video as JPEG.
class ViewImages {
 public:
  /// All except `source` must outlive it; `source` must not be restricted yet.
  ViewImages(const Arguments& arguments, const SlamMap& map, const ImageSource& source, MaskSource& masks);

  /// Marks an image as used. Others are not exported.
  void set_size(std::int64_t keyframe_id, int width, int height) { sizes_[keyframe_id] = {width, height}; }

  /// Writes to `images` and `masks` in a folder. If some images have a mask, all get one, as nerfstudio requires.
  /// Throws IoError, InvalidInput, OutputError.
  std::vector<OutputView> put(const std::filesystem::path& folder, const Similarity& file_from_map) const;

 private:
  struct Size {
    int width, height;
  };
  void put_masks(const std::filesystem::path& folder, std::vector<OutputView>& views) const;
  void write_decoded(const std::filesystem::path& folder, const std::map<std::int64_t, std::string>& names) const;

  const Arguments& arguments_;
  const SlamMap& map_;
  MaskSource& masks_;
  std::map<std::int64_t, ImageSource::Origin> origins_;
  std::map<std::int64_t, Size> sizes_;
};

}  // namespace pmsp::tool
