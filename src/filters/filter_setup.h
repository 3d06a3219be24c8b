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

template <class ViewTypes>
kernels::MedianFilter<ViewTypes> median_stage(const typename ViewTypes::Map& map, const kernels::GridView& grid,
                                              const typename ViewTypes::Mask& mask, const MedianFilterOptions& options,
                                              const typename ViewTypes::Planes& to) {
  return {map,
          grid,
          mask,
          options.enabled,
          static_cast<float>(options.max_relative_deviation),
          static_cast<float>(options.min_score),
          to};
}

/// Number of other maps that must agree; in proportion if there are fewer than in a full window.
inline int min_agreeing_maps(const ConsistencyFilterOptions& options, std::size_t others) {
  const double share = static_cast<double>(others) / (options.window - 1);
  const int full = options.min_views - 1;
  return std::min(full, std::max(1, static_cast<int>(std::lround(full * std::min(share, 1.0)))));
}

/// Consistency filter without the other maps, `count` of them. `pose_error`: Keyframe::pose_error; `with_pose_error`:
/// confidences that include it.
template <class ViewTypes>
kernels::ConsistencyFilter<ViewTypes> consistency_stage(const typename ViewTypes::Map& map,
                                                        const kernels::GridView& grid, std::size_t count,
                                                        const ConsistencyFilterOptions& options, double pose_error,
                                                        float* confidence, float* with_pose_error) {
  kernels::ConsistencyFilter<ViewTypes> stage{};
  stage.map = map;
  stage.grid = grid;
  stage.count = options.enabled ? static_cast<int>(count) : 0;
  stage.min_agreeing = min_agreeing_maps(options, count);
  const float pixel_angle = static_cast<float>(2.0 * kernels::kPi / grid.width);
  stage.tolerance =
      std::max(static_cast<float>(options.max_relative_depth), pixel_angle);  // at least the resolution of a map
  stage.width_factor = kernels::width_correction(grid.width);
  stage.pose_error = static_cast<float>(pose_error);
  stage.confidence = confidence;
  stage.with_pose_error = with_pose_error;
  return stage;
}

}  // namespace pmsp
