// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>

#include "pmsp/types.h"

namespace pmsp::tool {

/// Depth map as colour images.
struct DepthPicture {
  cv::Mat depth;          ///< BGR: inverse depth; black = none
  cv::Mat confidence;     ///< BGR: 0 violet to 1 yellow; black = none
  double near = 0.0;      ///< depth of the palette's high end (2nd percentile); 0 without depth
  double far = 0.0;       ///< depth of the palette's low end
  double coverage = 0.0;  ///< share of all pixels with a depth
  double mean_confidence = 0.0;
};

/// `palette`: one of OpenCV's colour maps, for depths.
DepthPicture draw_depth(const DepthMap& map, int palette);

/// Resizes an image to BGR of that size.
cv::Mat picture_of(ImageView<const Rgb> image, cv::Size size);
/// The same, at most `width` wide.
cv::Mat picture_of(ImageView<const Rgb> image, int width);

}  // namespace pmsp::tool
