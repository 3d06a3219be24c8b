// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "pmsp/depth_map.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/options.h"
#include "pmsp/point_cloud.h"

namespace pmsp {

/// A depth map on its way through fusion.
struct FusionInput {
  const DepthMap* map = nullptr;
  const Image<Rgb>* color = nullptr;  ///< of the map's size
  /// Of the map's size; nonzero where a point of an earlier keyframe already stands for the pixel. Written for maps
  /// that come later; all 0 at first.
  std::vector<std::uint8_t>* covered = nullptr;
};

/// Makes points of the pixels of `window[current]` that no earlier point stands for. Depth, normal and colour are
/// averages over the maps that agree, weighted with the inverse square of their expected errors (confidence, times the
/// distance). Each point covers the pixels of the later maps (`window[current + 1]` on) whose centre lies within
/// `options.spacing_px` of it. A pixel that a later map sees from much closer is left to that map. Throws
/// InvalidOption, and InvalidInput when sizes differ, something is missing or `current` is not in the window.
KeyframeCloud fuse(const std::vector<FusionInput>& window, std::size_t current, const FusionOptions& options,
                   const Executor& executor);

}  // namespace pmsp
