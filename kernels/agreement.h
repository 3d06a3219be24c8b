// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "plane.h"

// How a surface point of one keyframe looks from another one's depth map: the common ground of the consistency filter
// and of fusion. Depths are compared along the ray, with the other map's plane rather than its pixel's depth, so that a
// slanted surface does not disagree with itself between pixel centres.
namespace pmsp::kernels {

/// The other keyframe's map: planes in row order (zero = no estimate).
struct PlaneMapView {
  const float* x;
  const float* y;
  const float* z;
  int width, height;
};

/// Whether there is no map behind a view.
PMSP_HD bool is_empty(const PlaneMapView& map) { return map.x == nullptr; }

template <class F>
PMSP_HD Vec3<F> plane_at(const PlaneMapView& map, const IntOf<F>& index) {
  return {gather<F>(map.x, index), gather<F>(map.y, index), gather<F>(map.z, index)};
}

template <class F>
struct Agreement {
  F closeness;  ///< range of the point over the range of the other map's surface in its direction; 0 = nothing there
  F implied_depth;  ///< depth along the first keyframe's ray at which it meets the other map's plane
  /// By how much the other camera's direction to the point turns, over the relative change of depth [rad]: small where
  /// there is little parallax.
  F parallax_gain;
  IntOf<F> index;  ///< of that pixel
};

/// `bearing` (unit) and `depth` > 0 in the first keyframe. `Map`: PlaneMapView, or any other type with `width`,
/// `height` and `plane_at`.
template <class F, class Map>
PMSP_HD Agreement<F> agreement(const Vec3<F>& bearing, const F& depth, const Map& other,
                               const Rigid& other_from_first) {
  const Vec3<F> turned = rotate(other_from_first, bearing);
  const Vec3<F> t = translation<F>(other_from_first);
  const Vec3<F> p = fma(depth, turned, t);
  const IntOf<F> index = pixel_index(p, other.width, other.height);
  const Vec3<F> plane = plane_at<F>(other, index);
  const F closeness = dot(plane, p);
  const F along_ray = dot(plane, turned);
  const F rest = F(1) - dot(plane, t);
  const auto valid = (closeness > F(0)) & (along_ray > F(0)) & (rest > F(0));
  const Vec3<F> turn = cross(turned, t);
  const F gain = depth * sqrt(dot(turn, turn)) / max(dot(p, p), F(1e-30F));
  return {select(valid, closeness, F(0)), select(valid, rest / select(valid, along_ray, F(1)), F(0)), gain, index};
}

/// Where another map's surface lies behind the point by more than this many tolerances, that keyframe has looked
/// through it.
constexpr float kSeenThrough = 2.0F;

/// What the other maps say of one pixel.
struct Votes {
  int agree = 0;
  int contradict = 0;
  float square_spread = 0.0F;  ///< sum of squared deviations of the maps that agree
  float square_gain = 0.0F;    ///< sum of their squared parallax gains

  PMSP_HD void add(float closeness, float parallax_gain, float tolerance) {
    const float deviation = closeness - 1.0F;
    if (abs(deviation) <= tolerance) {
      ++agree;
      square_spread += deviation * deviation;
      square_gain += parallax_gain * parallax_gain;
    }
    if (closeness > 0.0F && closeness < 1.0F - kSeenThrough * tolerance) ++contradict;
  }
  PMSP_HD bool keep(int wanted) const { return agree >= wanted && (wanted == 0 || agree > contradict); }
};

/// How far a hypothesis lies from another map's surface: |range of its point / range of the surface in that direction -
/// 1|, 1 where the map has no estimate. `inverse_depth` > 0 along the unit `bearing` of the first keyframe.
template <class F, class Map>
PMSP_HD F disagreement(const Vec3<F>& bearing, const F& inverse_depth, const Map& other,
                       const Rigid& other_from_first) {
  const Vec3<F> p = fma(inverse_depth, translation<F>(other_from_first), rotate(other_from_first, bearing));
  const IntOf<F> index = pixel_index(p, other.width, other.height);
  const Vec3<F> plane = plane_at<F>(other, index);
  return abs(dot(plane, p) / inverse_depth - F(1));
}

}  // namespace pmsp::kernels
