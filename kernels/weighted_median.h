// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "fused_point.h"
#include "stage.h"

// Weighted median filter of stereo (Ma et al. 2013, "Constant time weighted median filtering for stereo matching and
// beyond"), on planes. At the edge of a near object a patch sees both surfaces, and the object grows by part of the
// patch; but the image shows its edge. Surrounding planes are weighted by similarity of colour, distance and score.
// Each is extended to the pixel's ray, and the one at the weighted median of inverse depth becomes the pixel's plane.
namespace pmsp::kernels {

constexpr int kMedianSide = 7;  ///< samples along one side of the window
constexpr int kMedianSamples = kMedianSide * kMedianSide;
constexpr int kMedianStep = 2;                                 ///< distance of samples [px]
constexpr int kMedianReach = kMedianStep * (kMedianSide / 2);  ///< from the middle to the side [px]
constexpr float kMedianSigmaSpace = 4.0F;                      ///< [px]
/// Standard deviation of colour distances [gray levels]. Larger values improve edges a little, and lose thin structures
/// of nearly the wall's colour.
constexpr float kMedianSigmaColor = 8.0F;
constexpr float kMedianChange = 0.005F;  ///< relative change of depth below which a pixel keeps its plane
constexpr int kMedianHalvings = 14;      ///< bisections of the interval of the median

// A pole or a cable covers few of the samples: its pixels would get planes of the background. They keep theirs if both
// sides are background and the structure continues in both directions. The band by which an edge grows is as narrow,
// but has the object itself on one side.
constexpr float kOnThinThing = 0.98F;      ///< minimum inverse depth of a sample on the structure, over the pixel's own
constexpr float kThinThingBehind = 12.0F;  ///< minimum pairs of opposite samples, of 24, in the background
constexpr float kThinThingAlong = 1.0F;    ///< minimum pairs on the structure
constexpr float kThinThingShare = 0.05F;   ///< minimum weight of the samples on the structure, of all

/// Offset of the k-th sample of a side from the middle [px at the equator].
PMSP_HD int median_offset(int k) { return kMedianStep * (k - kMedianSide / 2); }

/// Replaces planes by the weighted median of the surroundings; a stage. Unmasked pixels without a plane get one.
template <class ViewTypes>
struct WeightedMedian {
  static constexpr int kCounts = 0;

  typename ViewTypes::Map map;
  GridView grid;
  const std::uint32_t* color;  ///< per pixel red, green, blue, from the lowest byte
  typename ViewTypes::Mask mask;
  typename ViewTypes::Planes to;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* /*counted*/) const {
    F inverse_depth[kMedianSamples];
    F weight[kMedianSamples];
    filter(at, inverse_depth, weight);
  }

  /// `inverse_depth`, `weight`: storage for kMedianSamples numbers.
  template <class F, class Storage>
  PMSP_HD void filter(const RowPixels<F>& at, Storage inverse_depth, Storage weight) const {
    const Vec3<F> bearing = bearing_at(grid, at);
    Hypothesis<F> found{plane_at<F>(map, at.index), score_at<F>(map, at.index)};
    const F own = dot(found.plane, bearing);
    const MaskOf<F> wanted = is_unmasked<F>(mask, at.index);
    MaskOf<F> differs = wanted & (own <= F(0));
    for_each_sample(at, [&](int k, const IntOf<F>& there, int /*square*/) {
      const F inverse = dot(plane_at<F>(map, there), bearing);
      inverse_depth[k] = inverse;
      differs = differs | (wanted & (abs(inverse - own) > F(kMedianChange) * own));
    });
    if (any(differs)) {
      const F median = weighted_median(at, inverse_depth, weight);
      MaskOf<F> moves = wanted & (median > F(0)) & (abs(median - own) > F(kMedianChange) * own);
      const MaskOf<F> recedes = moves & (median < F(kBehindThinThing) * own);
      if (any(recedes)) moves = moves & !(recedes & is_thin(own, inverse_depth, weight));
      if (any(moves)) {
        F nearest = median;
        for_each_sample(at, [&](int k, const IntOf<F>& there, int /*square*/) {
          const F apart = abs(inverse_depth[k] - median);
          const MaskOf<F> this_one = moves & (apart < nearest);
          if (!any(this_one)) return;
          nearest = select(this_one, apart, nearest);
          found = {select(this_one, plane_at<F>(map, there), found.plane),
                   select(this_one, score_at<F>(map, there), found.score)};
        });
      }
    }
    put(to, static_cast<std::size_t>(at.first), at.count, found);
  }

 private:
  /// Calls visit(sample number, pixel index, squared distance from the middle [px]).
  template <class F, class Visit>
  PMSP_HD void for_each_sample(const RowPixels<F>& at, const Visit& visit) const {
    const F width(static_cast<float>(grid.width));
    const float stretch = column_stretch(grid, at.row, kMedianReach);
    PMSP_ROLL
    for (int j = 0; j < kMedianSide; ++j) {
      const int dy = median_offset(j);
      const WrappedPixel<F> middle = wrapped_pixel<F>(grid, at.column, at.row, 0, dy);
      const F column = from_int<F>(middle.column);
      const IntOf<F> first = middle.row * IntOf<F>(grid.width);
      PMSP_UNROLL
      for (int i = 0; i < kMedianSide; ++i) {
        const int dx = median_offset(i);
        const F x = column + F(static_cast<float>(static_cast<int>(stretch * static_cast<float>(dx))));
        const F around = select(x < F(0), x + width, select(x >= width, x - width, x));
        visit(j * kMedianSide + i, first + to_int(around), dx * dx + dy * dy);
      }
    }
  }

  /// Whether the pixel lies on a thin structure; see kOnThinThing.
  template <class F, class Storage>
  PMSP_HD static MaskOf<F> is_thin(const F& own, const Storage& inverse_depth, const Storage& weight) {
    const F on = F(kOnThinThing) * own;
    const F behind = F(kBehindThinThing) * own;
    F pairs_behind(0);
    F pairs_along(0);
    F share = F(weight[kMedianSamples / 2]);
    F total = share;
    for (int k = 0; k < kMedianSamples / 2; ++k) {
      const int opposite = kMedianSamples - 1 - k;
      const F one = inverse_depth[k];
      const F other = inverse_depth[opposite];
      pairs_behind = pairs_behind + select((max(one, other) < behind) & (min(one, other) > F(0)), F(1), F(0));
      pairs_along = pairs_along + select(min(one, other) > on, F(1), F(0));
      share = share + select(one > on, F(weight[k]), F(0)) + select(other > on, F(weight[opposite]), F(0));
      total = total + F(weight[k]) + F(weight[opposite]);
    }
    return (pairs_behind >= F(kThinThingBehind)) & (pairs_along >= F(kThinThingAlong)) &
           (share >= F(kThinThingShare) * total);
  }

  /// Smallest value with half of the weight at or below it; 0 = none.
  template <class F, class Storage>
  PMSP_HD F weighted_median(const RowPixels<F>& at, const Storage& inverse_depth, Storage weight) const {
    constexpr float kInSpace = 0.5F / (kMedianSigmaSpace * kMedianSigmaSpace);
    constexpr float kInColor = 0.5F / (kMedianSigmaColor * kMedianSigmaColor);
    const Vec3<F> own = color_of<F>(gather_words<F>(color, at.index));
    F total(0);
    F low(1e30F);
    F high(0);
    for_each_sample(at, [&](int k, const IntOf<F>& there, int square) {
      const Vec3<F> apart = color_of<F>(gather_words<F>(color, there)) - own;
      const F score = min(max(score_at<F>(map, there), F(0.05F)), F(1));
      const F score_square = score * score;
      const F unlike = fma(F(kInColor), dot(apart, apart), F(kInSpace * static_cast<float>(square)));
      const F similarity = kernels::exp(F(0) - min(unlike, F(60)));
      const F inverse = inverse_depth[k];
      const F counts = select(inverse > F(0), similarity * score_square * score_square, F(0));
      weight[k] = counts;
      total = total + counts;
      low = select(inverse > F(0), min(low, inverse), low);
      high = max(high, inverse);
    });
    const F half = F(0.5F) * total;
    low = F(0.99F) * low;
    PMSP_ROLL
    for (int i = 0; i < kMedianHalvings; ++i) {
      const F middle = sqrt(low * high);  // geometric mean: planes seen edge-on may have any depth
      F below(0);
      for (int k = 0; k < kMedianSamples; ++k) {
        below = below + select(inverse_depth[k] <= middle, F(weight[k]), F(0));
      }
      const MaskOf<F> enough = below >= half;
      high = select(enough, middle, high);
      low = select(enough, low, middle);
    }
    F median = F(0);
    for (int k = 0; k < kMedianSamples; ++k) {
      const F inverse = inverse_depth[k];
      const MaskOf<F> nearer = (weight[k] > F(0)) & (inverse > low);
      median = select(nearer & ((median <= F(0)) | (inverse < median)), inverse, median);
    }
    return median;
  }
};

}  // namespace pmsp::kernels
