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

/// What the images of a few keyframes say of a pairing.
struct Evidence {
  int comparisons = 0;     ///< landmarks that were sought
  double fit = 0.0;        ///< as PairingSeries::fit
  double least_fit = 0.0;  ///< as PairingSeries::least_fit
  double likeness = 0.0;   ///< as PairingSeries::likeness
  double deviation = 0.0;  ///< of the fit

  bool conclusive() const;
  bool fits() const { return conclusive() && fit >= least_fit; }
  bool may_fit() const;  ///< as poor images do, and no wrong ones
};

/// The image that a pairing gives a keyframe; nullptr where it gives none. Valid until the next call.
using ImageOf = std::function<const Image<Rgb>*(const MapKeyframe&)>;

/// How well images fit keyframes, which come in the order of time.
Evidence try_images(const SlamMap& map, const Keyframes& keyframes, const ImageOf& image_of,
                    const Presentation& how = {});

/// Whether they do when they are mirrored, flipped or turned.
bool fit_presented(const SlamMap& map, const Keyframes& keyframes, const ImageOf& image_of);

/// Keyframes in the order of time, without those that repeat the timestamp of an earlier id.
Keyframes keyframes_by_time(const SlamMap& map);

/// Up to four neighbours among the first, those with the most parallax between them and landmarks in common.
Keyframes first_run(const SlamMap& map, const Keyframes& by_time);

/// At most `pairs` pairs of neighbours, evenly spread.
Keyframes spread_pairs(const Keyframes& by_time, std::size_t pairs);

/// Frames of one recording, and how a reading of timestamps places keyframes among them once the frame of the first
/// keyframe of a run (the anchor) is known.
struct FrameReading {
  std::function<const Image<Rgb>*(std::int64_t frame)> image;  ///< nullptr = there is none; valid until the next call
  std::function<std::optional<std::int64_t>(const MapKeyframe&, std::int64_t anchor)> frame_of;
};

struct FoundAnchor {
  std::int64_t anchor = 0;
  Evidence evidence;
};

/// Tries each frame from `first` to `last` as the anchor of `run`, and what fits on `more` keyframes, too. Returns the
/// one that fits best; nullopt where none does, or where another one far from it does as well.
std::optional<FoundAnchor> find_anchor(const SlamMap& map, const Keyframes& run, const Keyframes& more,
                                       const FrameReading& reading, std::int64_t first, std::int64_t last);

}  // namespace pmsp::io
