// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "pairing_series.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::io {

using Keyframes = std::vector<const MapKeyframe*>;

/// Evidence of some keyframes' images for a pairing.
struct Evidence {
  int comparisons = 0;     ///< number of landmarks compared
  double fit = 0.0;        ///< see PairingSeries::fit
  double least_fit = 0.0;  ///< see PairingSeries::least_fit
  double likeness = 0.0;   ///< see PairingSeries::likeness
  double deviation = 0.0;  ///< standard deviation of `fit`

  bool conclusive() const;
  bool fits() const { return conclusive() && fit >= least_fit; }
  bool may_fit() const;  ///< possible for poor images, not for wrong ones
};

/// Image of a keyframe in a pairing; nullptr = none. Valid until the next call.
using ImageOf = std::function<const Image<Rgb>*(const MapKeyframe&)>;

/// Measures how well images fit keyframes, in temporal order.
Evidence try_images(const SlamMap& map, const Keyframes& keyframes, const ImageOf& image_of,
                    const Presentation& how = {});

/// True if mirrored, flipped or turned images fit.
bool fit_presented(const SlamMap& map, const Keyframes& keyframes, const ImageOf& image_of);

/// Keyframes by time, without repeated timestamps (the smallest id is kept).
Keyframes keyframes_by_time(const SlamMap& map);

/// Returns up to four adjacent keyframes near the beginning with much parallax and many common landmarks.
Keyframes first_run(const SlamMap& map, const Keyframes& by_time);

/// Returns at most `pairs` pairs of adjacent keyframes, evenly spread.
Keyframes spread_pairs(const Keyframes& by_time, std::size_t pairs);

/// Frames of a recording, and the frame of each keyframe given that of the first keyframe of a run (the anchor).
struct FrameReading {
  std::function<const Image<Rgb>*(std::int64_t frame)> image;  ///< nullptr = none; valid until the next call
  std::function<std::optional<std::int64_t>(const MapKeyframe&, std::int64_t anchor)> frame_of;
};

struct FoundAnchor {
  std::int64_t anchor = 0;
  Evidence evidence;
};

/// Tries frames `first` to `last` as the anchor of `run`, and verifies candidates on `more` keyframes. Returns the best
/// one; nullopt if none fits, or if a distant one fits equally well.
std::optional<FoundAnchor> find_anchor(const SlamMap& map, const Keyframes& run, const Keyframes& more,
                                       const FrameReading& reading, std::int64_t first, std::int64_t last);

}  // namespace pmsp::io
