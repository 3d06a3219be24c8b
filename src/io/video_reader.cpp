// SPDX-License-Identifier: BSD-2-Clause
#include "video_reader.h"

#include <cmath>
#include <string>
#include <system_error>

#include "pmsp/error.h"

namespace pmsp::io {
namespace {

constexpr double kFallbackStepFps = 30.0;  ///< if the video has no rate; step of frames without time

}  // namespace

bool is_frame_rate(double fps) { return std::isfinite(fps) && fps > 0.0 && fps < 1e5; }

VideoReader::VideoReader(const std::filesystem::path& path) : path_(path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path_, error))
    throw IoError(path_.string() + ": cannot be opened: " + (error ? error.message() : "it is no file") +
                  "; expected a video");
  try {
    // FFmpeg explicitly: other backends interpret digits in the name as an image sequence.
    capture_.open(path_.string(), cv::CAP_FFMPEG);
  } catch (const std::exception& e) {
    throw IoError(path_.string() + ": cannot be opened as a video: " + e.what());
  }
  if (!capture_.isOpened())
    throw IoError(path_.string() + ": cannot be opened as a video: broken, or no format that OpenCV's FFmpeg reads");
  fps_ = capture_.get(cv::CAP_PROP_FPS);
  frames_ = capture_.get(cv::CAP_PROP_FRAME_COUNT);
  if (!std::isfinite(frames_) || frames_ < 0.0) frames_ = 0.0;
  if (!advance()) throw IoError(path_.string() + ": not one frame of the video can be decoded");
}

bool VideoReader::advance() {
  bool grabbed = false;
  try {
    grabbed = !ended_ && capture_.grab();
  } catch (const std::exception& e) {
    throw IoError(path_.string() + ": frame " + std::to_string(index_ + 1) + " cannot be decoded: " + e.what());
  }
  if (!grabbed) {
    ended_ = true;
    return false;
  }
  ++index_;
  const double time = capture_.get(cv::CAP_PROP_POS_MSEC) / 1000.0;
  // OpenCV returns 0 for the last frames of a stream with B-frames, and for all frames of some formats.
  const double rate = is_frame_rate(fps_) ? fps_ : kFallbackStepFps;
  if (index_ == 0) {
    time_ = std::isfinite(time) ? time : 0.0;
  } else {
    time_ = std::isfinite(time) && time > 0.0 ? time : time_ + 1.0 / rate;
  }
  return true;
}

bool VideoReader::retrieve(cv::Mat& bgr) {
  try {
    return capture_.retrieve(bgr) && !bgr.empty();
  } catch (const std::exception& e) {
    throw IoError(path_.string() + ": frame " + std::to_string(index_) + " cannot be decoded: " + e.what());
  }
}

}  // namespace pmsp::io
