// SPDX-License-Identifier: BSD-2-Clause
#include "video_frames.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "image_decode.h"
#include "pmsp/error.h"

namespace pmsp::io {
namespace {

constexpr int kWidth = 640;  ///< [px]
constexpr int kJpegQuality = 92;
constexpr std::size_t kRecent = 8;  ///< decoded frames cached

}  // namespace

VideoFrames::VideoFrames(const std::filesystem::path& path, std::int64_t begin) : reader_(path), begin_(begin) {
  while (reader_.index() < begin_ && !ended_) ended_ = !reader_.advance();
}

bool VideoFrames::grow() {
  if (ended_ || static_cast<std::int64_t>(frames_.size()) >= kMost) return false;
  Frame frame;
  frame.time = reader_.time();
  cv::Mat bgr;
  bool decoded = false;
  try {
    decoded = reader_.retrieve(bgr);
  } catch (const IoError&) {  // reported when the frame is read
  }
  if (decoded) {
    if (bgr.cols > kWidth) {
      const int height = std::max(1, static_cast<int>(std::lround(1.0 * kWidth * bgr.rows / bgr.cols)));
      cv::resize(bgr, bgr, cv::Size(kWidth, height), 0.0, 0.0, cv::INTER_AREA);
    }
    cv::imencode(".jpg", bgr, frame.jpeg, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  }
  frames_.push_back(std::move(frame));
  try {
    ended_ = !reader_.advance();
  } catch (const IoError&) {
    ended_ = true;
  }
  return true;
}

const Image<Rgb>* VideoFrames::image(std::int64_t frame) {
  const std::int64_t at = frame - begin_;
  if (at < 0 || at >= kMost) return nullptr;
  while (static_cast<std::int64_t>(frames_.size()) <= at)
    if (!grow()) return nullptr;
  const auto known =
      std::find_if(recent_.begin(), recent_.end(), [frame](const auto& entry) { return entry.first == frame; });
  if (known != recent_.end()) return &known->second;
  const std::vector<std::uint8_t>& jpeg = frames_[static_cast<std::size_t>(at)].jpeg;
  if (jpeg.empty()) return nullptr;
  const cv::Mat bgr = cv::imdecode(jpeg, cv::IMREAD_COLOR);
  if (bgr.empty()) return nullptr;
  if (recent_.size() == kRecent) recent_.pop_front();
  recent_.emplace_back(frame, rgb_from_bgr(bgr));
  return &recent_.back().second;
}

std::optional<std::int64_t> VideoFrames::nearest(double time) {
  if (!std::isfinite(time)) return std::nullopt;
  while ((frames_.empty() || frames_.back().time < time) && grow()) continue;
  const auto after = std::lower_bound(frames_.begin(), frames_.end(), time,
                                      [](const Frame& frame, double t) { return frame.time < t; });
  std::optional<std::int64_t> best;
  double distance = 0.5 / (is_frame_rate(reader_.fps()) ? reader_.fps() : 1.0);
  for (const std::ptrdiff_t step : {-1, 0}) {
    const std::ptrdiff_t at = after - frames_.begin() + step;
    if (at < 0 || at >= static_cast<std::ptrdiff_t>(frames_.size())) continue;
    const double away = std::abs(frames_[static_cast<std::size_t>(at)].time - time);
    if (away > distance) continue;
    distance = away;
    best = begin_ + at;
  }
  return best;
}

}  // namespace pmsp::io
