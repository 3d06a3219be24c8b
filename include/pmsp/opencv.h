// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include <opencv2/core/mat.hpp>

#include "pmsp/error.h"
#include "pmsp/live.h"

// Conversion of OpenCV images. Header only: the core is built without OpenCV.
namespace pmsp {

/// Returns an image that shares the pixels of `image` (CV_8UC3 or CV_8UC1); pass a clone() of buffers that are reused.
/// `color`: channel order of CV_8UC3, by default that of cv::imread. Throws InvalidInput for other types.
inline LiveImage live_image(const cv::Mat& image, PixelFormat color = PixelFormat::kBgr) {
  if (image.type() != CV_8UC3 && image.type() != CV_8UC1) {
    throw InvalidInput("live_image: an image of type " + std::to_string(image.type()) +
                       "; expected CV_8UC3 or CV_8UC1");
  }
  LiveImage result;
  result.owner = std::make_shared<const cv::Mat>(image);
  result.data = image.data;
  result.width = image.cols;
  result.height = image.rows;
  result.stride = static_cast<std::ptrdiff_t>(image.step[0]);
  result.format = image.type() == CV_8UC1 ? PixelFormat::kGray : color;
  return result;
}

}  // namespace pmsp
