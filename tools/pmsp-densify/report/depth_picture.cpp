// SPDX-License-Identifier: BSD-2-Clause
#include "depth_picture.h"

#include <algorithm>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "map_figures.h"

namespace pmsp::tool {
namespace {

cv::Mat view_of(const Image<float>& image) {
  cv::Mat copy(image.height(), image.width(), CV_32FC1);
  for (int y = 0; y < image.height(); ++y) std::copy_n(image.row(y), image.width(), copy.ptr<float>(y));
  return copy;
}

// Colour-maps `values` from `low` to `high`; black without depth.
cv::Mat colored(const cv::Mat& values, const cv::Mat& depth, double low, double high, int map) {
  cv::Mat gray;
  const double scale = high > low ? 255.0 / (high - low) : 0.0;
  values.convertTo(gray, CV_8U, scale, -low * scale);
  cv::Mat image;
  cv::applyColorMap(gray, image, map);
  image.setTo(cv::Scalar(0, 0, 0), depth <= 0.0F);
  return image;
}

}  // namespace

DepthPicture draw_depth(const DepthMap& map, int palette) {
  const cv::Mat depth = view_of(map.depth);
  std::vector<double> inverse;
  double confidence_sum = 0.0;
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    if (map.depth.pixels()[i] <= 0.0F) continue;
    inverse.push_back(1.0 / static_cast<double>(map.depth.pixels()[i]));
    confidence_sum += static_cast<double>(map.confidence.pixels()[i]);
  }
  const double far = percentile(inverse, 2.0);
  const double near = percentile(inverse, 98.0);
  cv::Mat values;
  cv::divide(1.0, cv::max(depth, 1e-12), values);
  const auto valid = static_cast<double>(inverse.size());
  DepthPicture picture;
  picture.depth = colored(values, depth, far, near, palette);
  picture.confidence = colored(view_of(map.confidence), depth, 0.0, 1.0, cv::COLORMAP_VIRIDIS);
  picture.near = near > 0.0 ? 1.0 / near : 0.0;
  picture.far = far > 0.0 ? 1.0 / far : 0.0;
  picture.coverage = valid / static_cast<double>(map.depth.size());
  picture.mean_confidence = valid > 0.0 ? confidence_sum / valid : 0.0;
  return picture;
}

cv::Mat picture_of(ImageView<const Rgb> image, cv::Size size) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3, const_cast<Rgb*>(image.data),
                    static_cast<std::size_t>(image.stride) * sizeof(Rgb));  // read-only
  cv::Mat small;
  cv::resize(rgb, small, size, 0, 0, cv::INTER_AREA);
  cv::Mat picture;
  cv::cvtColor(small, picture, cv::COLOR_RGB2BGR);
  return picture;
}

cv::Mat picture_of(ImageView<const Rgb> image, int width) {
  if (image.width <= width) return picture_of(image, {image.width, image.height});
  return picture_of(image, {width, std::max(1, image.height * width / image.width)});
}

}  // namespace pmsp::tool
