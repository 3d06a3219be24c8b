// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "confidence.h"
#include "median.h"
#include "pmsp/options.h"

// Stages of the filters, for all backends.
namespace pmsp {

template <class Views>
kernels::MedianFilter<Views> median_stage(const typename Views::Map& map, const kernels::GridView& grid,
                                          const typename Views::Mask& mask, const MedianFilterOptions& options,
                                          const typename Views::Planes& to) {
  return {map,
          grid,
          mask,
          options.enabled,
          static_cast<float>(options.max_relative_deviation),
          static_cast<float>(options.min_score),
          to};
}

/// Number of other maps that must agree; in proportion if there are fewer than in a full window.
inline int agreeing_maps_wanted(const ConsistencyFilterOptions& options, std::size_t others) {
  const double share = static_cast<double>(others) / (options.window - 1);
  const int full = options.min_views - 1;
  return std::min(full, std::max(1, static_cast<int>(std::lround(full * std::min(share, 1.0)))));
}

/// Consistency filter without the other maps, `count` of them. `pose_error`: Keyframe::pose_error; `reported`:
/// confidences that include it.
template <class Views>
kernels::ConsistencyFilter<Views> consistency_stage(const typename Views::Map& map, const kernels::GridView& grid,
                                                    std::size_t count, const ConsistencyFilterOptions& options,
                                                    double pose_error, float* confidence, float* reported) {
  kernels::ConsistencyFilter<Views> stage{};
  stage.map = map;
  stage.grid = grid;
  stage.count = options.enabled ? static_cast<int>(count) : 0;
  stage.wanted = agreeing_maps_wanted(options, count);
  const float pixel_angle = static_cast<float>(2.0 * kernels::kPi / grid.width);
  stage.tolerance =
      std::max(static_cast<float>(options.max_relative_depth), pixel_angle);  // at least the resolution of a map
  stage.share = kernels::share_of_coarse_map(grid.width);
  stage.pose_error = static_cast<float>(pose_error);
  stage.confidence = confidence;
  stage.to_report = reported;
  return stage;
}

}  // namespace pmsp
