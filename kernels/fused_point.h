// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "agreement.h"
#include "fusion.h"
#include "grid_view.h"
#include "surfel.h"

// The point of one pixel: the average over the maps of its window that agree, the same whichever keyframe's turn it is.
namespace pmsp::kernels {

/// A map of the window: its surfaces after the consistency filter. `Map`: as agreement() takes it.
template <class Map>
struct FusionView {
  Map planes;
  const float* confidence;
  const std::uint32_t* color;  ///< of each pixel red, green, blue, from the lowest byte on
  Rigid other_from_first;      ///< from the first keyframe's unit of length into the other's: the rotation times `zoom`
  float zoom;                  ///< the first keyframe's scale over the other's
};

struct FusionLimits {
  float max_relative_depth;
  float min_cos_normals;
  float min_confidence;
};

constexpr int kMaxAgree = 32;  ///< other maps that can be asked: one bit each

template <class F>
PMSP_HD Vec3<F> color_of(const UIntOf<F>& color) {
  using U = UIntOf<F>;
  return {from_uint<F>(U(color & U(255U))), from_uint<F>(U((color >> 8) & U(255U))),
          from_uint<F>(U((color >> 16) & U(255U)))};
}

template <class F>
struct FusedPixel {
  PackedPoint<UIntOf<F>> point;
  UIntOf<F> standing;  ///< kOpen with the confidence of the pixel's own map
  UIntOf<F> agree;     ///< bit k: others[k] does
};

/// Makes the points of a keyframe's pixels; a stage.
template <class Map>
struct FusePixels {
  FusionView<Map> first;
  GridView grid;
  const FusionView<Map>* others;
  int count;  ///< of `others`, kMaxAgree at most
  FusionLimits limits;

  template <class F>
  PMSP_HD FusedPixel<F> at(const IntOf<F>& column, const IntOf<F>& row) const {
    using U = UIntOf<F>;
    const IntOf<F> index = row * IntOf<F>(first.planes.width) + column;
    const Vec3<F> bearing = bearing_at<F>(grid, column, row);
    const Vec3<F> found = plane_at<F>(first.planes, index);
    const F confidence = gather<F>(first.confidence, index);
    const MaskOf<F> known = (dot(found, bearing) > F(0)) & (confidence >= F(limits.min_confidence));
    if (!any(known)) return {{U(0U), U(0U)}, U(0U), U(0U)};
    const Vec3<F> plane = select(known, found, bearing);
    const F depth = F(1) / dot(plane, bearing);
    const Vec3<F> normal = F(-1) * normalized(plane);
    F weights = fusion_weight(confidence, depth);
    F depths = weights * depth;
    Vec3<F> normals = weights * normal;
    Vec3<F> colors = weights * color_of<F>(gather_words<F>(first.color, index));
    U agree(0U);
    for (int k = 0; k < count; ++k) {
      const FusionView<Map>& other = others[k];
      const Agreement<F> seen = agreement(bearing, depth, other.planes, other.other_from_first);
      const MaskOf<F> near = known & (abs(seen.closeness - F(1)) <= F(limits.max_relative_depth));
      if (!any(near)) continue;
      const Vec3<F> there = select(near, plane_at<F>(other.planes, seen.index), plane);
      const Vec3<F> turned =
          F(1.0F / other.zoom) * rotate_back(other.other_from_first, Vec3<F>(F(-1) * normalized(there)));
      const MaskOf<F> same = near & (dot(turned, normal) >= F(limits.min_cos_normals));
      const Vec3<F> p = transform(other.other_from_first, Vec3<F>(depth * bearing));
      const F closeness = select(same, seen.closeness, F(1));
      const F other_depth = sqrt(dot(p, p)) / (F(other.zoom) * closeness);  // in the first one's unit
      const F weight = select(same, fusion_weight(gather<F>(other.confidence, seen.index), other_depth), F(0));
      weights = weights + weight;
      depths = fma(weight, seen.implied_depth, depths);
      normals = fma(weight, turned, normals);
      colors = fma(weight, color_of<F>(gather_words<F>(other.color, seen.index)), colors);
      agree = agree | select_bits<F>(same, U(1U << static_cast<unsigned>(k)));
    }
    const F share = F(1) / weights;
    const PackedPoint<U> point =
        pack_point(F(depths * share), normalized(normals), Vec3<F>(share * colors), confidence);
    return {{select_bits<F>(known, point.surfel), select_bits<F>(known, point.detail)},
            select_bits<F>(known, pack_standing(confidence, Standing::kOpen)),
            agree};
  }
};

}  // namespace pmsp::kernels
