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

/// Frames of a video in any order, reduced: those from a certain one on are decoded once, up to `kMost`, and kept
/// compressed.
class VideoFrames {
 public:
  static constexpr std::int64_t kMost = 3000;

  /// Throws IoError.
  VideoFrames(const std::filesystem::path& path, std::int64_t begin);

  std::int64_t begin() const { return begin_; }

  /// nullptr where the frame is not among them. Valid until the next call.
  const Image<Rgb>* image(std::int64_t frame);

  /// Presentation time of a frame that has an image [s].
  double time(std::int64_t frame) const { return frames_[static_cast<std::size_t>(frame - begin_)].time; }

  /// The frame nearest to a presentation time, at most half a mean frame away.
  std::optional<std::int64_t> nearest(double time);

 private:
  struct Frame {
    double time = 0.0;
    std::vector<std::uint8_t> jpeg;
  };

  /// Decodes one more; false at the end.
  bool grow();

  VideoReader reader_;
  std::int64_t begin_;
  bool ended_ = false;
  std::vector<Frame> frames_;
  std::deque<std::pair<std::int64_t, Image<Rgb>>> recent_;
};

}  // namespace pmsp::io
