// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>

#include "pmsp/types.h"

namespace pmsp::tool {

/// A depth map as pictures.
struct DepthPicture {
  cv::Mat depth;          ///< BGR: inverse depth; black where there is none
  cv::Mat confidence;     ///< BGR: 0 violet to 1 yellow; black where there is none
  double near = 0.0;      ///< depth of the high end of the palette, 98 % of the pixels are farther; 0 without any
  double far = 0.0;       ///< of the low end
  double coverage = 0.0;  ///< share of all pixels with a depth
  double mean_confidence = 0.0;
};

/// `palette`: of the depths, one of OpenCV's colour maps.
DepthPicture draw_depth(const DepthMap& map, int palette);

/// BGR, of that size.
cv::Mat picture_of(ImageView<const Rgb> image, cv::Size size);
/// The same at most `width` wide.
cv::Mat picture_of(ImageView<const Rgb> image, int width);

}  // namespace pmsp::tool
