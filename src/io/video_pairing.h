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

/// How the frames of keyframes are found in a video.
struct VideoPairing {
  enum class Reading { kPresentationTime, kIndexFromTime, kSourceFrame };
  Reading reading = Reading::kPresentationTime;
  double unit = 1.0;        ///< of the map's timestamps [s]
  double rate = 0.0;        ///< that turns timestamps into frame indices [1/s]
  double t0 = 0.0;          ///< timestamp at the start of the video [s]
  std::int64_t offset = 0;  ///< added to frame indices
  std::string description;  ///< a clause for people

  /// Presentation time that a keyframe's timestamp stands for [s].
  double time(const MapKeyframe& keyframe) const { return keyframe.timestamp * unit - t0; }

  /// Index of the keyframe's frame; nullopt where its timestamp gives none.
  std::optional<std::int64_t> index(const MapKeyframe& keyframe) const;
};

/// Takes what `options` say; else the reading of timestamps, and the constant offset, that fit what a few frames show
/// of the map's landmarks. Throws InvalidInput where nothing decides; IoError.
VideoPairing choose_video_pairing(const SlamMap& map, const std::filesystem::path& path, const VideoOptions& options,
                                  const VideoReader& video);

}  // namespace pmsp::io
