// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "agreement.h"
#include "equirect.h"
#include "pmsp/depth_map.h"
#include "pmsp/options.h"
#include "sphere/grid.h"
#include "util/eigen_kernels.h"
#include "util/thread_pool.h"

namespace pmsp {

inline std::int64_t count_depths(const DepthMap& map) {
  const std::vector<float>& depths = map.depth.pixels();
  return std::count_if(depths.begin(), depths.end(), [](float depth) { return depth > 0.0F; });
}

inline bool same_size(const DepthMap& a, const DepthMap& b) {
  return a.depth.width() == b.depth.width() && a.depth.height() == b.depth.height();
}

/// Restores the rule that normal and confidence are 0 where depth is.
inline void clear_where_no_depth(DepthMap& map) {
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    if (map.depth.pixels()[i] > 0.0F) continue;
    map.normal.pixels()[i].setZero();
    map.confidence.pixels()[i] = 0.0F;
  }
}

/// How many of the other maps must agree: where fewer are at hand than the window holds, in proportion.
inline int agreeing_maps_wanted(const ConsistencyFilterOptions& options, std::size_t others) {
  const double share = static_cast<double>(others) / (options.window - 1);
  const int full = options.min_views - 1;
  return std::min(full, std::max(1, static_cast<int>(std::lround(full * std::min(share, 1.0)))));
}

/// The plane of a pixel that has a depth (see PlaneImage).
inline kernels::Vec3<float> plane_of_pixel(const DepthMap& map, const SphereGrid& grid, int x, int y) {
  return kernels::plane_from(
      1.0F / map.depth(x, y), to_vec3(map.normal(x, y)),
      kernels::bearing(grid.sin_lon()[x], grid.cos_lon()[x], grid.sin_lat()[y], grid.cos_lat()[y]));
}

/// A depth map's planes in row order, one array a coordinate, as kernels::agreement reads them.
class PlaneRows {
 public:
  /// `confidence`: where it is 0 there is no plane; nullptr = not asked.
  PlaneRows(const DepthMap& map, const SphereGrid& grid, ThreadPool& pool, const Image<float>* confidence = nullptr)
      : width_(map.depth.width()),
        height_(map.depth.height()),
        x_(map.depth.size()),
        y_(map.depth.size()),
        z_(map.depth.size()) {
    pool.for_each(height_, [&](int row) {
      for (int column = 0; column < width_; ++column) {
        const std::size_t at =
            static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(column);
        if (map.depth(column, row) <= 0.0F) continue;
        if (confidence != nullptr && !((*confidence)(column, row) > 0.0F)) continue;
        const kernels::Vec3<float> plane = plane_of_pixel(map, grid, column, row);
        x_[at] = plane.x;
        y_[at] = plane.y;
        z_[at] = plane.z;
      }
    });
  }

  kernels::PlaneMapView view() const { return {x_.data(), y_.data(), z_.data(), width_, height_}; }

 private:
  int width_, height_;
  std::vector<float> x_, y_, z_;
};

/// Buffers for one row of comparisons.
struct CompareBuffers {
  explicit CompareBuffers(int width)
      : closeness(static_cast<std::size_t>(width)),
        implied_depth(closeness.size()),
        parallax_gain(closeness.size()),
        index(closeness.size()) {}

  cpu::CompareRow out() { return {closeness.data(), implied_depth.data(), parallax_gain.data(), index.data()}; }

  std::vector<float> closeness, implied_depth, parallax_gain;
  std::vector<std::int32_t> index;
};

}  // namespace pmsp
