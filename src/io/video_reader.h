// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/videoio.hpp>

namespace pmsp::io {

/// True for what can be a frame rate.
bool is_frame_rate(double fps);

/// Frames of a video one after the other, with their presentation times.
class VideoReader {
 public:
  /// Grabs the first frame. Throws IoError.
  explicit VideoReader(const std::filesystem::path& path);

  /// Grabs the next frame; false at the end of the video. Throws IoError.
  bool advance();

  /// Decodes the frame that was grabbed last; false where it cannot be decoded. Throws IoError.
  bool retrieve(cv::Mat& bgr);

  std::int64_t index() const { return index_; }  ///< of the frame that was grabbed last
  double time() const { return time_; }          ///< its presentation time [s]

  double fps() const { return fps_; }        ///< mean rate; what the container says may be no rate at all [1/s]
  double frames() const { return frames_; }  ///< as the container says; 0 = it does not

  /// Stands in where the video has no rate.
  void set_fallback_fps(double fps) {
    if (!is_frame_rate(fps_)) fps_ = fps;
  }

 private:
  std::filesystem::path path_;
  cv::VideoCapture capture_;
  double fps_ = 0.0;
  double frames_ = 0.0;
  std::int64_t index_ = -1;
  double time_ = 0.0;
  bool ended_ = false;
};

}  // namespace pmsp::io
