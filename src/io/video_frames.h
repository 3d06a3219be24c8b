// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "pmsp/types.h"
#include "video_reader.h"

namespace pmsp::io {

/// Random access to reduced frames of a video: at most `kMost` from a start frame, decoded once and stored compressed.
class VideoFrames {
 public:
  static constexpr std::int64_t kMost = 3000;

  /// Throws IoError.
  VideoFrames(const std::filesystem::path& path, std::int64_t begin);

  std::int64_t begin() const { return begin_; }

  /// nullptr if the frame is out of range. Valid until the next call.
  const Image<Rgb>* image(std::int64_t frame);

  /// Presentation time of a frame with an image [s].
  double time(std::int64_t frame) const { return frames_[static_cast<std::size_t>(frame - begin_)].time; }

  /// Frame nearest to a presentation time, within half the mean interval.
  std::optional<std::int64_t> nearest(double time);

 private:
  struct Frame {
    double time = 0.0;
    std::vector<std::uint8_t> jpeg;
  };

  /// Decodes the next frame; false at the end.
  bool grow();

  VideoReader reader_;
  std::int64_t begin_;
  bool ended_ = false;
  std::vector<Frame> frames_;
  std::deque<std::pair<std::int64_t, Image<Rgb>>> recent_;
};

}  // namespace pmsp::io
