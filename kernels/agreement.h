// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "plane.h"
#include "rigid.h"

// Comparison of a surface point of one keyframe with the depth map of another, for the consistency filter and fusion.
// Depths are compared along the ray, with the plane of the other map instead of the depth of its pixel, so that slanted
// surfaces agree with themselves between pixel centres.
namespace pmsp::kernels {

/// Plane map in host memory, in row order; zero plane = no estimate. `score`: nullptr if unused.
struct PlaneMapView {
  const float* x;
  const float* y;
  const float* z;
  int width, height;
  const float* score = nullptr;
};

PMSP_HD bool is_empty(const PlaneMapView& map) { return map.x == nullptr; }

template <class F>
PMSP_HD Vec3<F> plane_at(const PlaneMapView& map, const IntOf<F>& index) {
  return {gather<F>(map.x, index), gather<F>(map.y, index), gather<F>(map.z, index)};
}

template <class F>
PMSP_HD F score_at(const PlaneMapView& map, const IntOf<F>& index) {
  return gather<F>(map.score, index);
}

/// Weight of another keyframe's evidence on a point, relative to that of the point's keyframe: (own distance / other
/// distance)^4, from squared distances in one unit. Errors at edges widen with distance and thin structures are missed
/// from afar: many distant keyframes must not outvote a near one that sees a cable.
template <class F>
PMSP_HD F evidence_weight(const F& own_square, const F& other_square) {
  constexpr float kMost = 1e6F;  // the other camera may be at the point
  const F nearer = min(own_square / max(other_square, F(1e-30F)), F(kMost));
  return nearer * nearer;
}

template <class F>
struct Agreement {
  F depth_ratio;    ///< range of the point / range of the other map's surface in its direction; 0 = none
  F implied_depth;  ///< depth on the first keyframe's ray where it meets the other map's plane
  /// Rotation of the other camera's ray to the point per relative change of depth [rad]; small with little parallax.
  F parallax_gain;
  F weight;        ///< see evidence_weight
  IntOf<F> index;  ///< of the pixel in the other map
  Vec3<F> point;   ///< in the other camera's frame
};

/// `bearing`: unit, in the first keyframe; `depth` > 0. `Map`: PlaneMapView, or another type with `width`, `height` and
/// `plane_at`.
template <class F, class Map>
PMSP_HD Agreement<F> agreement(const Vec3<F>& bearing, const F& depth, const Map& other,
                               const Rigid& other_from_first) {
  const Vec3<F> turned = rotate(other_from_first, bearing);
  const Vec3<F> t = translation(other_from_first, bearing, Vec3<F>(depth * turned), F(1));
  const Vec3<F> p = fma(depth, turned, t);
  const IntOf<F> index = pixel_index(p, other.width, other.height);
  const Vec3<F> plane = plane_at<F>(other, index);
  const F depth_ratio = dot(plane, p);
  const F along_ray = dot(plane, turned);
  const F rest = F(1) - dot(plane, t);
  const auto valid = (depth_ratio > F(0)) & (along_ray > F(0)) & (rest > F(0));
  const Vec3<F> epipolar_normal = cross(turned, t);
  const F square = dot(p, p);
  const F gain = depth * sqrt(dot(epipolar_normal, epipolar_normal)) / max(square, F(1e-30F));
  const F weight = evidence_weight(F(depth * depth * dot(turned, turned)), square);
  return {select(valid, depth_ratio, F(0)),
          select(valid, rest / select(valid, along_ray, F(1)), F(0)),
          gain,
          weight,
          index,
          p};
}

/// Distance [tolerances] from which on a farther surface of another map contradicts a point: the point is seen through.
constexpr float kSeenThrough = 2.0F;

template <class F>
PMSP_HD MaskOf<F> is_seen_through(const Agreement<F>& seen, float tolerance) {
  return (seen.depth_ratio > F(0)) & (seen.depth_ratio < F(1.0F - kSeenThrough * tolerance));
}

/// Maximum inverse depth of the background of a thin structure, over that of the structure.
constexpr float kBehindThinThing = 0.97F;
constexpr int kThinThingSide = 5;    ///< from the middle of a thin structure to its background [px]
constexpr int kBesideThinThing = 2;  ///< search radius for a thin structure in another map [px]

/// Returns the depth ratio nearest to 1 among the other map's pixels within kBesideThinThing of the projected point, if
/// one agrees; else that of the projected pixel. A structure two pixels wide misses its projected pixel as soon as
/// poses and pixels are half a pixel off.
template <class F, class Map>
PMSP_HD F depth_ratio_around(const Agreement<F>& seen, const Map& other, float tolerance) {
  const F width(static_cast<float>(other.width));
  const F height(static_cast<float>(other.height));
  const Pixel<F> at = project(seen.point, width, height);
  F found = seen.depth_ratio;
  F least(tolerance);
  for (int dy = -kBesideThinThing; dy <= kBesideThinThing; ++dy) {
    const F y = min(max(at.y + F(static_cast<float>(dy)), F(0)), height);
    const IntOf<F> first = row(y, other.height) * IntOf<F>(other.width);
    const int reach = kBesideThinThing - (dy < 0 ? -dy : dy);
    for (int dx = -reach; dx <= reach; ++dx) {
      const F x = at.x + F(static_cast<float>(dx));
      const F around = select(x < F(0), x + width, select(x > width, x - width, x));
      const F ratio = dot(plane_at<F>(other, first + column(around, other.width)), seen.point);
      const F deviation = abs(ratio - F(1));
      found = select(deviation <= least, ratio, found);
      least = min(deviation, least);
    }
  }
  return found;
}

/// Sums over the other maps at a pixel.
template <class F>
struct Votes {
  F agree = F(0);           ///< number of agreeing maps
  F could_see = F(0);       ///< number of maps whose surface does not hide the pixel, agreeing ones included
  F weight_for = F(0);      ///< of agreeing maps
  F weight_against = F(0);  ///< of contradicting maps (seen through)
  F square_spread = F(0);   ///< sum of squared deviations of agreeing maps
  F square_gain = F(0);     ///< sum of squared parallax gains of agreeing maps

  PMSP_HD void add(const Agreement<F>& seen, float tolerance) {
    const F deviation = seen.depth_ratio - F(1);
    const MaskOf<F> near = abs(deviation) <= F(tolerance);
    const MaskOf<F> through = is_seen_through(seen, tolerance);
    agree = agree + select(near, F(1), F(0));
    could_see = could_see + select((seen.depth_ratio > F(0)) & (deviation <= F(kSeenThrough * tolerance)), F(1), F(0));
    weight_for = weight_for + select(near, seen.weight, F(0));
    weight_against = weight_against + select(through, seen.weight, F(0));
    square_spread = square_spread + select(near, deviation * deviation, F(0));
    square_gain = square_gain + select(near, seen.parallax_gain * seen.parallax_gain, F(0));
  }
  /// `min_agreeing`: number of maps that must agree; if fewer could see the point, all of those, at least one. 0 = all
  /// pixels are kept.
  PMSP_HD MaskOf<F> keep(int min_agreeing) const {
    const MaskOf<F> enough = agree >= min(F(static_cast<float>(min_agreeing)), max(could_see, F(1)));
    return min_agreeing == 0 ? enough : enough & (weight_for > weight_against);
  }
};

/// Relative distance of a hypothesis behind another map's surface: range of its point / range of the surface in that
/// direction - 1; negative in front of it, -1 without an estimate. `inverse_depth`: > 0, along the unit `bearing` of
/// the first keyframe.
template <class F, class Map>
PMSP_HD F beyond_surface(const Vec3<F>& bearing, const F& inverse_depth, const Map& other,
                         const Rigid& other_from_first) {
  const Vec3<F> turned = rotate(other_from_first, bearing);
  const Vec3<F> p = fma(inverse_depth, translation(other_from_first, bearing, turned, inverse_depth), turned);
  const IntOf<F> index = pixel_index(p, other.width, other.height);
  return dot(plane_at<F>(other, index), p) / inverse_depth - F(1);
}

}  // namespace pmsp::kernels
