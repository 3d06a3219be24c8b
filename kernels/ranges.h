// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "rigid.h"
#include "stage.h"
#include "vec3.h"

// What a keyframe's depth map says of a point of another one: it has the point on its surface, it has looked through
// the point at something farther away, or it says nothing (the point is hidden, or the direction has no depth).
namespace pmsp::kernels {

/// How far a keyframe has seen, in cells of several pixels, in row order.
struct RangeMapView {
  const float* nearest;   ///< smallest depth in the cell, 0 = none known
  const float* farthest;  ///< largest depth
  int width, height;
};

struct FreeSpaceLimits {
  float min_through;  ///< range over nearest depth below which a point has been looked through, below min_near
  float min_near;     ///< from here on it lies on the surface,
  float max_far;      ///< up to this range over farthest depth
};

/// What a keyframe says of a point; at most one of the two.
template <class F>
struct RangeVote {
  MaskOf<F> on_surface, through;
  F square;  ///< of its distance from the point, in its unit
};

/// `point` in the first keyframe, not the place of the other camera.
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
  const MaskOf<F> through = range < nearest * F(limits.min_through);  // false where nothing is known
  return {on_surface, through, square};
}

/// Keyframes that can be asked: one bit each.
constexpr int kMaxViewers = 32;

/// A keyframe that may have looked through a point.
struct Viewer {
  RangeMapView ranges;
  Rigid other_from_first;  ///< from the first keyframe's unit of length into the other's: the rotation times `zoom`
  float zoom;              ///< the first keyframe's scale over the other's
};

/// Side of a cell [px].
constexpr int kRangeCell = 2;

/// How far a keyframe has seen (pmsp::range_map), cell by cell; a stage.
template <class Machine>
struct FindRanges {
  static constexpr int kCounts = 0;

  FilteredMap<typename Machine::Map> map;
  GridView grid;  ///< of the map
  float* nearest;
  float* farthest;

  PMSP_HD int width() const { return grid.width / kRangeCell; }
  PMSP_HD int height() const { return grid.height / kRangeCell; }

  template <class F>
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* /*counted*/) const {
    F low(0);
    F high(0);
    for (int i = 0; i < kRangeCell * kRangeCell; ++i) {
      const IntOf<F> column = at.column * IntOf<F>(kRangeCell) + IntOf<F>(i % kRangeCell);
      const IntOf<F> row(at.row * kRangeCell + i / kRangeCell);
      const Surface<F> surface =
          surface_of(plane_at<F>(map, row * IntOf<F>(grid.width) + column), bearing_at<F>(grid, column, row));
      const F depth = select(surface.known, surface.depth, F(0));
      low = select((low > F(0)) & (min(low, depth) > F(0)), min(low, depth), max(low, depth));
      high = max(high, select(depth < F(1.0F / kFarLimit), depth, F(0)));  // a far pixel is no surface to lie on
    }
    store<F>(low, nearest + at.first, at.count);
    store<F>(high, farthest + at.first, at.count);
  }
};

}  // namespace pmsp::kernels
