// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/image.h"

namespace pmsp {

/// Reads a mask: 0 = ignore, any other = use. It is scaled to `width` x `height` without growing what may be used: a
/// pixel is used (255, else 0) only if all that it covers is. Throws IoError, or InvalidInput when the shape is not
/// that of the images, the mask leaves no pixel, or the file looks like a photo or a depth map: a tenth of its pixels
/// lie outside its eight commonest colours.
PMSP_API Image<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height);

/// What is to be ignored in the images of a mission.
struct MaskOptions {
  /// Empty: nothing. An image as read_mask takes it, for all images. A folder with one for each: image "a/7.jpg" has
  /// "a/7.jpg.png" (as in COLMAP) or else "a/7.png"; an image without one is used as a whole. A YAML configuration of
  /// stella_vslam or OpenVSLAM (.yaml, .yml): its `mask_rectangles`, each [x_min, x_max, y_min, y_max] as shares of
  /// width and height.
  std::filesystem::path path;
  std::filesystem::path images;  ///< the folder that images lie in; names in a folder of masks are relative to it
  double nadir_deg = 0.0;        ///< radius of a cap around the lowest row that is ignored, too, 0 to 90 [deg]
};

/// Gives each image its mask, in the image's size.
class PMSP_API MaskSource {
 public:
  /// Throws InvalidOption, IoError where there is no such file or folder, InvalidInput where it is no such YAML.
  explicit MaskSource(const MaskOptions& options);
  ~MaskSource();

  bool is_folder() const;  ///< one for each image

  /// What the mask of an image is read from; empty where nothing is.
  std::filesystem::path file_for(const std::filesystem::path& image) const;

  /// How many of the images have a mask. Throws InvalidInput where a folder of masks has none for any of them.
  std::size_t count(const std::vector<std::filesystem::path>& images) const;

  /// Empty where nothing is to be ignored; stays until the next call. Throws as read_mask.
  ImageView<const std::uint8_t> mask_for(const std::filesystem::path& image, int width, int height);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
