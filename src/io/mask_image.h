// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "pmsp/types.h"

namespace pmsp::io {

/// Mask in the size of its file.
struct MaskImage {
  cv::Mat usable;         ///< 8 bits, 0 = ignored
  std::string colours;    ///< commonest colours, for messages: "90 % #ffffff, 10 % #ff0000"
  bool by_alpha = false;  ///< read from the alpha channel
};

/// Decodes a mask: black pixels are ignored (0 in all channels, in JPEGs less than half). If the colours hide nothing
/// or everything, or are those of a photo, the alpha channel decides: less than half is ignored. Throws as read_mask.
/// `instances`: pixels are ids of objects instead, and those > 0 are ignored.
MaskImage decode_mask(const std::filesystem::path& path, bool instances = false);

/// Scales a mask as read_mask does. `what`: its name in messages. Throws InvalidInput if the aspect ratio differs.
Image<std::uint8_t> scale_mask(const std::string& what, const cv::Mat& usable, int width, int height);

/// Returns the alpha channel of an image as MaskImage::usable; empty if missing, or if it hides nothing or everything.
/// Throws as decode_image_file.
cv::Mat image_opacity(const std::filesystem::path& image);

/// Returns the ignored share of the sphere, 0 to 1: rows weighted by solid angle.
double hidden_share(ImageView<const std::uint8_t> mask);

}  // namespace pmsp::io
