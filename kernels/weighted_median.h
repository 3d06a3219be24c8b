// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "fused_point.h"
#include "stage.h"

// The weighted median filter of stereo (Ma et al. 2013, "Constant time weighted median filtering for stereo matching
// and beyond"), on planes. At the edge of a near thing a patch sees both surfaces, and the near one grows by a part of
// the patch; but the image shows where it ends. Of the planes around, those count that belong to pixels of a similar
// colour, that are near, and that match well. Each is drawn on to the pixel's ray, and the one that gives the weighted
// median of inverse depth becomes the pixel's own.
namespace pmsp::kernels {

constexpr int kMedianSide = 7;  ///< planes looked at along one side of the window
constexpr int kMedianSamples = kMedianSide * kMedianSide;
constexpr int kMedianStep = 2;                                 ///< from one to the next [px]
constexpr int kMedianReach = kMedianStep * (kMedianSide / 2);  ///< from the middle to the side [px]
constexpr float kMedianSigmaSpace = 4.0F;                      ///< [px]
/// Larger ones gain a little at edges (12: F at 1 % + 0.001), and lose thin things whose colour is much like the
/// wall's.
constexpr float kMedianSigmaColor = 8.0F;  ///< of the distance between colours [gray levels]
constexpr float kMedianChange = 0.005F;    ///< relative change of depth below which a pixel keeps its plane
constexpr int kMedianHalvings = 14;        ///< of the interval that holds the median

/// Offset of sample k from the middle [px of the equator].
PMSP_HD void median_offset(int k, int& dx, int& dy) {
  dx = kMedianStep * (k % kMedianSide - kMedianSide / 2);
  dy = kMedianStep * (k / kMedianSide - kMedianSide / 2);
}

/// Moves planes to the weighted median around; a stage. Pixels without a plane get one, where a depth is wanted.
template <class Machine>
struct WeightedMedian {
  static constexpr int kCounts = 0;

  typename Machine::Map map;
  GridView grid;
  const std::uint32_t* color;  ///< of each pixel red, green, blue, from the lowest byte on
  typename Machine::Mask mask;
  typename Machine::Planes to;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* /*counted*/) const {
    const Vec3<F> bearing = bearing_at(grid, at);
    Hypothesis<F> found{plane_at<F>(map, at.index), score_at<F>(map, at.index)};
    const F own = dot(found.plane, bearing);
    const MaskOf<F> wanted = is_usable<F>(mask, at.index);
    F inverse_depth[kMedianSamples];
    MaskOf<F> differs = wanted & (own <= F(0));
    PMSP_UNROLL
    for (int k = 0; k < kMedianSamples; ++k) {
      inverse_depth[k] = dot(plane_at<F>(map, index_of(at, k)), bearing);
      differs = differs | (wanted & (abs(inverse_depth[k] - own) > F(kMedianChange) * own));
    }
    if (any(differs)) {
      const F median = weighted_median(at, inverse_depth);
      const MaskOf<F> moves = wanted & (median > F(0)) & (abs(median - own) > F(kMedianChange) * own);
      if (any(moves)) {
        F nearest = median;
        PMSP_ROLL
        for (int k = 0; k < kMedianSamples; ++k) {
          const IntOf<F> there = index_of(at, k);
          const Vec3<F> plane = plane_at<F>(map, there);
          const F apart = abs(dot(plane, bearing) - median);
          const MaskOf<F> this_one = moves & (apart < nearest);
          nearest = select(this_one, apart, nearest);
          found = {select(this_one, plane, found.plane), select(this_one, score_at<F>(map, there), found.score)};
        }
      }
    }
    put(to, static_cast<std::size_t>(at.first), at.count, found);
  }

 private:
  template <class F>
  PMSP_HD IntOf<F> index_of(const Place<F>& at, int k) const {
    const float stretch = column_stretch(grid, at.row, kMedianReach);
    int dx = 0;
    int dy = 0;
    median_offset(k, dx, dy);
    return index_beside(grid, at, static_cast<int>(stretch * static_cast<float>(dx)), dy);
  }

  /// The smallest of the values that has half of the weight at or below it; 0 where there is none.
  template <class F>
  PMSP_HD F weighted_median(const Place<F>& at, const F* inverse_depth) const {
    const Vec3<F> own = color_of<F>(gather_words<F>(color, at.index));
    F weight[kMedianSamples];
    F total(0);
    F low(1e30F);
    F high(0);
    PMSP_UNROLL
    for (int k = 0; k < kMedianSamples; ++k) {
      const IntOf<F> there = index_of(at, k);
      const Vec3<F> apart = color_of<F>(gather_words<F>(color, there)) - own;
      const F score = min(max(score_at<F>(map, there), F(0.05F)), F(1));
      const F square = score * score;
      const F unlike = fma(F(0.5F / (kMedianSigmaColor * kMedianSigmaColor)), dot(apart, apart), F(distance(k)));
      const F likeness = kernels::exp(F(0) - min(unlike, F(60)));
      weight[k] = select(inverse_depth[k] > F(0), likeness * square * square, F(0));
      total = total + weight[k];
      low = select(inverse_depth[k] > F(0), min(low, inverse_depth[k]), low);
      high = max(high, inverse_depth[k]);
    }
    const F half = F(0.5F) * total;
    low = F(0.99F) * low;
    PMSP_ROLL
    for (int i = 0; i < kMedianHalvings; ++i) {
      const F middle = sqrt(low * high);  // planes seen edge-on may have any depth
      F below(0);
      PMSP_UNROLL
      for (int k = 0; k < kMedianSamples; ++k) {
        below = below + select(inverse_depth[k] <= middle, weight[k], F(0));
      }
      const MaskOf<F> enough = below >= half;
      high = select(enough, middle, high);
      low = select(enough, low, middle);
    }
    F median = F(0);
    PMSP_UNROLL
    for (int k = 0; k < kMedianSamples; ++k) {
      const MaskOf<F> nearer = (weight[k] > F(0)) & (inverse_depth[k] > low);
      median = select(nearer & ((median <= F(0)) | (inverse_depth[k] < median)), inverse_depth[k], median);
    }
    return median;
  }

  /// In standard deviations, squared and halved.
  static PMSP_HD float distance(int k) {
    int dx = 0;
    int dy = 0;
    median_offset(k, dx, dy);
    return 0.5F / (kMedianSigmaSpace * kMedianSigmaSpace) * static_cast<float>(dx * dx + dy * dy);
  }
};

}  // namespace pmsp::kernels
