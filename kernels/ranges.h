// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "rigid.h"
#include "stage.h"
#include "vec3.h"

// Evidence of a keyframe's depth map on a point of another keyframe: on the surface; seen through (the surface is
// farther); or none (the point is hidden, or there is no depth in its direction).
namespace pmsp::kernels {

/// Range map of a keyframe: cells of several pixels, in row order.
struct RangeMapView {
  const float* nearest;   ///< smallest depth in the cell, 0 = none
  const float* farthest;  ///< largest depth
  int width, height;
};

struct FreeSpaceLimits {
  float through_below;  ///< seen through: range / nearest below this; less than min_near
  float min_near;       ///< on the surface: range / nearest from this
  float max_far;        ///< on the surface: range / farthest up to this
};

/// Evidence of a keyframe on a point; at most one of the two masks is set.
template <class F>
struct RangeVote {
  MaskOf<F> on_surface, through;
  F square;  ///< squared distance of its camera from the point, in its unit
};

/// `point`: in the first keyframe, not at the other camera.
template <class F>
PMSP_HD RangeVote<F> range_vote(const Vec3<F>& point, const RangeMapView& other, const Rigid& other_from_first,
                                const FreeSpaceLimits& limits) {
  const Vec3<F> p = transform(other_from_first, point);
  const F square = dot(p, p);
  const F range = sqrt(square);
  const IntOf<F> index = pixel_index(p, other.width, other.height);
  const F nearest = gather<F>(other.nearest, index);
  const F farthest = gather<F>(other.farthest, index);
  const MaskOf<F> on_surface = (range >= nearest * F(limits.min_near)) & (range <= farthest * F(limits.max_far));
  const MaskOf<F> through = range < nearest * F(limits.through_below);  // false without a depth
  return {on_surface, through, square};
}

/// Maximum number of viewers: one bit each.
constexpr int kMaxViewers = 32;

/// Viewer of the free-space test.
struct Viewer {
  RangeMapView ranges;
  Rigid other_from_first;  ///< from the first keyframe's unit into the other's: the rotation times `scale_ratio`
  float scale_ratio;       ///< first keyframe's scale / the other's
};

/// Side of a cell [px].
constexpr int kRangeCell = 2;

/// Range map of a keyframe (pmsp::range_map); a stage over its cells.
template <class ViewTypes>
struct FindRanges {
  static constexpr int kCounts = 0;

  FilteredMap<typename ViewTypes::Map> map;
  GridView grid;  ///< of the map
  float* nearest;
  float* farthest;

  PMSP_HD int width() const { return grid.width / kRangeCell; }
  PMSP_HD int height() const { return grid.height / kRangeCell; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* /*counted*/) const {
    F low(0);
    F high(0);
    for (int i = 0; i < kRangeCell * kRangeCell; ++i) {
      const IntOf<F> column = at.column * IntOf<F>(kRangeCell) + IntOf<F>(i % kRangeCell);
      const IntOf<F> row(at.row * kRangeCell + i / kRangeCell);
      const Surface<F> surface =
          surface_of(plane_at<F>(map, row * IntOf<F>(grid.width) + column), bearing_at<F>(grid, column, row));
      const F depth = select(surface.known, surface.depth, F(0));
      low = select((low > F(0)) & (min(low, depth) > F(0)), min(low, depth), max(low, depth));
      high = max(high, select(depth < F(1.0F / kFarLimit), depth, F(0)));  // a far pixel is no surface
    }
    store<F>(low, nearest + at.first, at.count);
    store<F>(high, farthest + at.first, at.count);
  }
};

}  // namespace pmsp::kernels
