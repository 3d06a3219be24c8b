// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "video_reader.h"

namespace pmsp::io {

/// Mapping from keyframes to frames of a video.
struct VideoPairing {
  enum class Reading { kPresentationTime, kIndexFromTime, kSourceFrame };
  Reading reading = Reading::kPresentationTime;
  double unit = 1.0;        ///< of the map's timestamps [s]
  double rate = 0.0;        ///< from timestamps to frame indices [1/s]
  double t0 = 0.0;          ///< timestamp at the start of the video [s]
  std::int64_t offset = 0;  ///< added to frame indices
  std::string description;  ///< for messages

  /// Presentation time of a keyframe [s].
  double time(const MapKeyframe& keyframe) const { return keyframe.timestamp * unit - t0; }

  /// Frame index of a keyframe; nullopt if the timestamp is out of range.
  std::optional<std::int64_t> index(const MapKeyframe& keyframe) const;
};

/// Returns the pairing set by `options`; otherwise the reading of timestamps and the constant offset that fit the
/// landmarks in some frames. Throws InvalidInput if undecided; IoError.
VideoPairing choose_video_pairing(const SlamMap& map, const std::filesystem::path& path, const VideoOptions& options,
                                  const VideoReader& video);

}  // namespace pmsp::io
