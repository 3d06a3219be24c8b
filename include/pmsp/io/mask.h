// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/image.h"

namespace pmsp {

/// Reads a mask: black (0 in every channel; in a JPEG, less than half) = ignore, any other colour = use. Where the
/// colours ignore nothing or everything, or are those of a photo, an alpha channel decides: transparent (less than
/// half) = ignore. It is scaled to `width` x `height` without growing what may be used: a pixel is used (255, else 0)
/// only if all that it covers is. Throws IoError, or InvalidInput when the shape is not that of the images, the mask
/// leaves no pixel, or the file looks like a photo or a depth map: a tenth of its pixels lie outside its eight
/// commonest colours.
PMSP_API Image<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height);

/// Whether an image's format and header allow for an alpha channel; false where it cannot be read.
PMSP_API bool may_have_alpha(const std::filesystem::path& image);

/// What is to be ignored in the images of a mission.
struct MaskOptions {
  /// Empty: what `found` says. An image as read_mask takes it, for all images. A folder with one for each: image
  /// "a/7.jpg" has "a/7.jpg.png" (COLMAP, OpenSfM), "a/7.png", "a/7_mask.png" (Metashape, ODM), "a/7.mask.png"
  /// (OpenMVS), or one of these names in another image format, or without "a/"; an image without one is used as a
  /// whole. A YAML configuration of stella_vslam or OpenVSLAM (.yaml, .yml): its `mask_rectangles`, each [x_min, x_max,
  /// y_min, y_max] as shares of width and height.
  std::filesystem::path path;
  std::filesystem::path images;  ///< the folder that images lie in; names in a folder of masks are relative to it
  double nadir_deg = 0.0;        ///< radius of a cap around the lowest row that is ignored, too, 0 to 90 [deg]
  double zenith_deg = 0.0;       ///< of one around the highest row, 0 to 90 [deg]
  /// Whether masks that come with the images count: the alpha channel of an image always; without a `path` also what
  /// the map names for it, else a mask in the folder `masks` beside that of the images, else "7_mask.png" or
  /// "7.mask.png" beside it.
  bool found = true;
  std::map<std::filesystem::path, std::filesystem::path> named{};  ///< the mask that the map names, by image
};

/// Where masks of images were found, and how much they hide.
struct MaskSummary {
  std::size_t images = 0;                        ///< all
  std::size_t in_folder = 0;                     ///< with a mask in the folder of MaskOptions::path
  std::size_t named = 0;                         ///< with one that the map names
  std::size_t named_missing = 0;                 ///< whose mask, as the map names it, is not there
  std::filesystem::path first_missing;           ///< the first of these masks
  std::size_t in_masks = 0;                      ///< with one in the folder `masks` beside that of the images
  std::size_t beside = 0;                        ///< with one beside the image
  std::filesystem::path first;                   ///< the first file of a mask
  std::vector<std::filesystem::path> unmatched;  ///< in the folder of MaskOptions::path, but of no image
  std::size_t looked_at = 0;                     ///< images with a mask that what follows is of
  std::size_t with_alpha = 0;                    ///< of these, images whose alpha channel hides something
  bool by_alpha = false;                         ///< the first file of a mask is read from its alpha channel
  double hidden = 0.0;                           ///< share of the sphere that is ignored, mean, 0 to 1
  double least = 0.0, most = 0.0;                ///< the same of one image
  double hidden_by_files = 0.0;                  ///< the same of the files alone, without alpha and caps, mean
  std::string colours;                           ///< of `first`, for people: "90 % #ffffff, 10 % #ff0000"
};

/// Gives each image its mask, in the image's size.
class PMSP_API MaskSource {
 public:
  /// Throws InvalidOption, IoError where there is no such file or folder, InvalidInput where it is no such YAML.
  explicit MaskSource(const MaskOptions& options);
  ~MaskSource();

  /// Hides these pixels in all images, too (0 = ignore), scaled to their size; empty = none.
  void set_rig(Image<std::uint8_t> mask);

  bool is_folder() const;  ///< MaskOptions::path is one

  /// What the mask of an image is read from, its alpha channel apart; empty where nothing is.
  std::filesystem::path file_for(const std::filesystem::path& image) const;

  /// Whether file_for, and thereby the mask, may differ from image to image.
  bool is_per_image(const std::filesystem::path& image) const;

  /// Whether anything of the image may be ignored, by what is known without decoding.
  bool has_mask(const std::filesystem::path& image) const;

  /// Looks at all masks of the images, or at 16 of them, evenly spread, as they are in images of that size. Throws as
  /// read_mask; InvalidInput where a folder of masks has none for any of them.
  MaskSummary look(const std::vector<std::filesystem::path>& images, int width, int height);

  /// Empty where nothing is to be ignored; stays until the next call. Throws as read_mask.
  ImageView<const std::uint8_t> mask_for(const std::filesystem::path& image, int width, int height);

 private:
  void look_at(const std::vector<std::filesystem::path>& images, int width, int height, MaskSummary& summary);

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
