// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/error_images.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "pmsp-eval/picture_file.h"

namespace pmsp::eval {
namespace {

constexpr int kLegendHeight = 24;
constexpr double kMinShownError = 0.001;
constexpr double kMaxShownError = 0.1;

using Entries = std::vector<std::pair<std::string, cv::Scalar>>;

uchar channel(double value) { return static_cast<uchar>(std::clamp(value, 0.0, 255.0)); }

/// Colours in BGR order.
cv::Vec3b view_color(bool hit, bool known, double error, double bound) {
  if (!hit) return {0, 0, 0};
  if (!known) return {200, 110, 40};
  if (error <= bound) return {40, channel(230.0 - 110.0 * error / bound), 40};
  return {40, 40, channel(130.0 + 25.0 * error / bound)};
}

/// Logarithmic: 0 at kMinShownError to 255 at kMaxShownError.
uchar shown_level(double error) {
  const double position = std::log(std::max(error, 1e-9) / kMinShownError) / std::log(kMaxShownError / kMinShownError);
  return channel(255.0 * position);
}

cv::Mat turbo() {
  cv::Mat levels(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i) levels.at<uchar>(0, i) = static_cast<uchar>(i);
  cv::Mat colors;
  cv::applyColorMap(levels, colors, cv::COLORMAP_TURBO);
  return colors;
}

cv::Mat with_legend(const cv::Mat& image, const Entries& entries) {
  cv::Mat result(image.rows + kLegendHeight, image.cols, CV_8UC3, cv::Scalar(255, 255, 255));
  image.copyTo(result.rowRange(0, image.rows));
  const int step = image.cols / static_cast<int>(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const int x = static_cast<int>(i) * step + 4;
    cv::rectangle(result, {x, image.rows + 5}, {x + 14, image.rows + 19}, entries[i].second, cv::FILLED);
    cv::putText(result, entries[i].first, {x + 20, image.rows + 17}, cv::FONT_HERSHEY_SIMPLEX, 0.4, {0, 0, 0}, 1,
                cv::LINE_AA);
  }
  return result;
}

}  // namespace

void write_view_image(const std::filesystem::path& path, const Image<float>& range, const Image<float>& error,
                      double max_relative_error) {
  cv::Mat image(range.height(), range.width(), CV_8UC3);
  for (int y = 0; y < range.height(); ++y) {
    for (int x = 0; x < range.width(); ++x) {
      const bool known = !error.empty() && !std::isnan(error(x, y));
      image.at<cv::Vec3b>(y, x) =
          view_color(range(x, y) > 0.0F, known, known ? static_cast<double>(error(x, y)) : 0.0, max_relative_error);
    }
  }
  write_png(path, with_legend(image, {{"within " + percent(max_relative_error), {40, 200, 40}},
                                      {"wrong", {40, 40, 200}},
                                      {"truth unknown", {200, 110, 40}},
                                      {"no point", {0, 0, 0}}}));
}

void write_depth_error_image(const std::filesystem::path& path, const Image<float>& error, int width) {
  const cv::Mat colors = turbo();
  cv::Mat image(error.height(), error.width(), CV_8UC3, cv::Scalar(0, 0, 0));
  for (int y = 0; y < error.height(); ++y) {
    for (int x = 0; x < error.width(); ++x) {
      const float e = error(x, y);
      if (!std::isnan(e)) image.at<cv::Vec3b>(y, x) = colors.at<cv::Vec3b>(0, shown_level(static_cast<double>(e)));
    }
  }
  cv::Mat shown;
  cv::resize(image, shown, {width, width / 2}, 0.0, 0.0, cv::INTER_NEAREST);
  Entries entries;
  for (const double e : {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1}) {
    const cv::Vec3b& color = colors.at<cv::Vec3b>(0, shown_level(e));
    entries.push_back({percent(e), cv::Scalar(color[0], color[1], color[2])});
  }
  entries.push_back({"unknown", {0, 0, 0}});
  write_png(path, with_legend(shown, entries));
}

}  // namespace pmsp::eval
