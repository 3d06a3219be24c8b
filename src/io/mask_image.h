// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "pmsp/types.h"

namespace pmsp::io {

/// A mask in its file's own size.
struct MaskImage {
  cv::Mat usable;         ///< 8 bits, 0 = ignore
  std::string colours;    ///< the commonest, for people: "90 % #ffffff, 10 % #ff0000"
  bool by_alpha = false;  ///< read from the alpha channel
};

/// A pixel is ignored where its colour is black: 0 in every channel, in a JPEG less than half. Where colour ignores
/// nothing or everything, or is a photo's, an alpha channel decides: less than half is ignored. Throws as read_mask.
MaskImage decode_mask(const std::filesystem::path& path);

/// Scaled as read_mask says. `what` names it in messages. Throws InvalidInput when the shape is another.
Image<std::uint8_t> scale_mask(const std::string& what, const cv::Mat& usable, int width, int height);

/// The alpha channel of an image as MaskImage::usable; empty where there is none, or it hides nothing or everything.
/// Throws as decode_image_file.
cv::Mat image_opacity(const std::filesystem::path& image);

/// Share of the sphere that is ignored, 0 to 1: rows weigh by the solid angle that they cover.
double hidden_share(ImageView<const std::uint8_t> mask);

}  // namespace pmsp::io
