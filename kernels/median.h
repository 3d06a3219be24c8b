// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "stage.h"

namespace pmsp::kernels {

template <class F>
PMSP_HD void order(F& a, F& b) {
  const F low = min(a, b);
  b = max(a, b);
  a = low;
}

/// Median of nine values, by the 19 exchanges of the smallest known network (Paeth 1990). Modifies `v`.
template <class F>
PMSP_HD F median9(F* v) {
  order(v[1], v[2]);
  order(v[4], v[5]);
  order(v[7], v[8]);
  order(v[0], v[1]);
  order(v[3], v[4]);
  order(v[6], v[7]);
  order(v[1], v[2]);
  order(v[4], v[5]);
  order(v[7], v[8]);
  order(v[0], v[3]);
  order(v[5], v[8]);
  order(v[4], v[7]);
  order(v[3], v[6]);
  order(v[1], v[4]);
  order(v[2], v[5]);
  order(v[4], v[7]);
  order(v[4], v[2]);
  order(v[6], v[4]);
  order(v[4], v[2]);
  return v[4];
}

/// Returns the depth if it is close to the median of its neighbourhood and its score suffices, else 0. `around`: 3 x 3
/// depths, the pixel's in the middle; missing ones (0) count as the pixel's. Modifies `around`.
template <class F>
PMSP_HD F median_filtered(F* around, const F& score, const F& max_relative_deviation, const F& min_score) {
  const F depth = around[4];
  for (int i = 0; i < 9; ++i) around[i] = select(around[i] > F(0), around[i], depth);
  const F median = median9(around);
  const auto kept = (abs(depth - median) <= max_relative_deviation * median) & (score >= min_score);
  return select(kept, depth, F(0));
}

/// Median filter (pmsp::median_filter); a stage. Counts unmasked pixels, pixels with a plane, kept ones.
template <class ViewTypes>
struct MedianFilter {
  static constexpr int kCounts = 3;

  typename ViewTypes::Map map;
  GridView grid;
  typename ViewTypes::Mask mask;
  bool enabled;
  float max_relative_deviation;
  float min_score;
  typename ViewTypes::Planes to;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* counted) const {
    const Vec3<F> plane = plane_at<F>(map, at.index);
    const Surface<F> own = surface_of(plane, bearing_at(grid, at));
    const F score = max(score_at<F>(map, at.index), F(0));
    MaskOf<F> kept = own.known;
    if (enabled && any(kept)) {
      F around[9];
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const WrappedPixel<F> there = wrapped_pixel<F>(grid, at.column, at.row, dx, dy);
          const Surface<F> surface = surface_of(plane_at<F>(map, there.row * IntOf<F>(grid.width) + there.column),
                                                bearing_at<F>(grid, there.column, there.row));
          around[3 * dy + dx + 4] = select(surface.known, surface.depth, F(0));
        }
      }
      kept = kept & (median_filtered(around, score, F(max_relative_deviation), F(min_score)) > F(0));
    }
    const Vec3<F> none{F(0), F(0), F(0)};
    put(to, static_cast<std::size_t>(at.first), at.count,
        Hypothesis<F>{select(kept, plane, none), select(kept, score, F(0))});
    counted[0] = is_unmasked<F>(mask, at.index);
    counted[1] = own.known;
    counted[2] = kept;
  }
};

}  // namespace pmsp::kernels
