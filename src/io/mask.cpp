// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <unordered_map>
#include <vector>

#include "image_decode.h"
#include "pmsp/error.h"
#include "pmsp/io/mask.h"

namespace pmsp {
namespace {

/// Source elements [begin, end) that target element i covers, even if only partly, when n_source are scaled to
/// n_target.
struct Span {
  int begin, end;
};

Span covered(int i, int n_source, int n_target) {
  const std::int64_t begin = static_cast<std::int64_t>(i) * n_source / n_target;
  const std::int64_t end = ((static_cast<std::int64_t>(i) + 1) * n_source + n_target - 1) / n_target;
  return {static_cast<int>(begin), static_cast<int>(end)};
}

constexpr int kLookedAt = 640;  ///< columns and rows at most
constexpr std::size_t kCommonest = 8;
constexpr double kMaxOthers = 0.1;

/// Masks have few colours; soft edges and JPEG add others to few pixels.
void refuse_photo(const std::filesystem::path& path, const cv::Mat& image) {
  cv::Mat some;
  cv::resize(image, some, {std::min(image.cols, kLookedAt), std::min(image.rows, kLookedAt)}, 0, 0, cv::INTER_NEAREST);
  some.convertTo(some, CV_16U);
  std::unordered_map<std::uint64_t, int> colours;
  const int looked_at = some.rows * some.cols;
  for (int y = 0; y < some.rows; ++y) {
    const auto* row = some.ptr<std::uint16_t>(y);
    for (int x = 0; x < some.cols; ++x) {
      std::uint64_t colour = 0;
      for (int c = 0; c < some.channels(); ++c) colour = colour << 16U | row[x * some.channels() + c];
      ++colours[colour];
    }
  }
  std::vector<int> counts;
  for (const auto& colour : colours) counts.push_back(colour.second);
  std::sort(counts.rbegin(), counts.rend());
  int others = 0;
  for (std::size_t i = kCommonest; i < counts.size(); ++i) others += counts[i];
  if (others <= kMaxOthers * looked_at) return;
  throw InvalidInput(path.string() + ": is no mask: it has " + std::to_string(counts.size()) +
                     " colours, as a photo or a depth map; expected an image that is 0 (black) where to ignore and one "
                     "other colour where to use");
}

/// 255 where any channel is not 0.
cv::Mat usable_pixels(const cv::Mat& image) {
  cv::Mat usable(image.rows, image.cols, CV_8UC1, cv::Scalar(0));
  for (int c = 0; c < image.channels(); ++c) {
    cv::Mat channel;
    cv::extractChannel(image, channel, c);
    usable |= channel != 0;
  }
  return usable;
}

}  // namespace

Image<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height) {
  if (width <= 0 || height <= 0)
    throw InvalidOption("read_mask: size " + std::to_string(width) + "x" + std::to_string(height) + ", expected > 0");
  // Depth is kept and gray is not made here: both would round small values to 0.
  const cv::Mat image = io::decode_image_file(path, cv::IMREAD_ANYDEPTH | cv::IMREAD_COLOR);
  refuse_photo(path, image);
  const cv::Mat mask = usable_pixels(image);
  if (static_cast<std::int64_t>(mask.cols) * height != static_cast<std::int64_t>(mask.rows) * width)
    throw InvalidInput(path.string() + ": the mask is " + std::to_string(mask.cols) + "x" + std::to_string(mask.rows) +
                       ", but the images are " + std::to_string(width) + "x" + std::to_string(height) +
                       "; expected that size or the same shape scaled");
  if (cv::countNonZero(mask) == 0)
    throw InvalidInput(path.string() + ": every pixel of the mask is 0 (ignore); expected 0 = ignore, others = use");

  Image<std::uint8_t> narrow(width, mask.rows);  // the least value along rows, then along columns
  for (int y = 0; y < mask.rows; ++y) {
    const std::uint8_t* row = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < width; ++x) {
      const Span span = covered(x, mask.cols, width);
      narrow(x, y) = *std::min_element(row + span.begin, row + span.end);
    }
  }
  Image<std::uint8_t> out(width, height, 255);
  for (int y = 0; y < height; ++y) {
    const Span span = covered(y, mask.rows, height);
    for (int from = span.begin; from < span.end; ++from)
      for (int x = 0; x < width; ++x) out(x, y) = std::min(out(x, y), narrow(x, from));
  }
  return out;
}

}  // namespace pmsp
