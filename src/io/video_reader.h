// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/videoio.hpp>

namespace pmsp::io {

/// True for plausible frame rates.
bool is_frame_rate(double fps);

/// Sequential frames of a video with presentation times.
class VideoReader {
 public:
  /// Grabs the first frame. Throws IoError.
  explicit VideoReader(const std::filesystem::path& path);

  /// Grabs the next frame; false at the end of the video. Throws IoError.
  bool advance();

  /// Decodes the last grabbed frame; false if undecodable. Throws IoError.
  bool retrieve(cv::Mat& bgr);

  std::int64_t index() const { return index_; }  ///< of the last grabbed frame
  double time() const { return time_; }          ///< its presentation time [s]

  double fps() const { return fps_; }        ///< mean rate, possibly invalid as the container's [1/s]
  double frames() const { return frames_; }  ///< according to the container; 0 = unknown

  /// Used if the video has no rate.
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
