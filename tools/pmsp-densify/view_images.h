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

/// A mask as PNG of that size: white = use. `mask`: of that size; empty = use all. Throws OutputError.
std::vector<unsigned char> mask_png(ImageView<const std::uint8_t> mask, int width, int height);

/// The mission's images, for datasets: copies of files, or frames of the video as JPEG; and their masks.
class ViewImages {
 public:
  /// All must outlive it but `source`, which is not restricted to some keyframes yet.
  ViewImages(const Arguments& arguments, const SlamMap& map, const ImageSource& source, MaskSource& masks);

  /// Of an image that is used. Others are left out.
  void set_size(std::int64_t keyframe_id, int width, int height) { sizes_[keyframe_id] = {width, height}; }

  /// Puts them into `images` and `masks` in a folder. Where some have a mask, all get one, as nerfstudio wants it.
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
