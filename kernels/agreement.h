// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "plane.h"
#include "rigid.h"

// How a surface point of one keyframe looks from another one's depth map: the common ground of the consistency filter
// and of fusion. Depths are compared along the ray, with the other map's plane rather than its pixel's depth, so that a
// slanted surface does not disagree with itself between pixel centres.
namespace pmsp::kernels {

/// A keyframe's map in host memory: planes in row order (zero = no estimate), and their scores where they are asked
/// for.
struct PlaneMapView {
  const float* x;
  const float* y;
  const float* z;
  int width, height;
  const float* score = nullptr;
};

/// Whether there is no map behind a view.
PMSP_HD bool is_empty(const PlaneMapView& map) { return map.x == nullptr; }

template <class F>
PMSP_HD Vec3<F> plane_at(const PlaneMapView& map, const IntOf<F>& index) {
  return {gather<F>(map.x, index), gather<F>(map.y, index), gather<F>(map.z, index)};
}

template <class F>
PMSP_HD F score_at(const PlaneMapView& map, const IntOf<F>& index) {
  return gather<F>(map.score, index);
}

/// How much another keyframe's word on a point counts, beside that of the keyframe whose point it is: the inverse
/// fourth power of their distances from it. How wide errors at edges are grows with the distance, and what is thin is
/// missed from afar: many far keyframes must not outvote the near one that sees a cable. Squared distances in one unit.
template <class F>
PMSP_HD F weight_of_word(const F& own_square, const F& other_square) {
  constexpr float kMost = 1e6F;  // a keyframe may stand where the point is
  const F nearer = min(own_square / max(other_square, F(1e-30F)), F(kMost));
  return nearer * nearer;
}

template <class F>
struct Agreement {
  F depth_ratio;  ///< range of the point over the range of the other map's surface in its direction; 0 = nothing there
  F implied_depth;  ///< depth along the first keyframe's ray at which it meets the other map's plane
  /// By how much the other camera's direction to the point turns, over the relative change of depth [rad]: small where
  /// there is little parallax.
  F parallax_gain;
  F weight;        ///< of what that map says
  IntOf<F> index;  ///< of that pixel
  Vec3<F> point;   ///< in the other keyframe
};

/// `bearing` (unit) and `depth` > 0 in the first keyframe. `Map`: PlaneMapView, or any other type with `width`,
/// `height` and `plane_at`.
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
  const Vec3<F> turn = cross(turned, t);
  const F square = dot(p, p);
  const F gain = depth * sqrt(dot(turn, turn)) / max(square, F(1e-30F));
  const F weight = weight_of_word(F(depth * depth * dot(turned, turned)), square);
  return {select(valid, depth_ratio, F(0)),
          select(valid, rest / select(valid, along_ray, F(1)), F(0)),
          gain,
          weight,
          index,
          p};
}

/// Where another map's surface lies behind the point by more than this many tolerances, that keyframe has looked
/// through it.
constexpr float kSeenThrough = 2.0F;

template <class F>
PMSP_HD MaskOf<F> is_seen_through(const Agreement<F>& seen, float tolerance) {
  return (seen.depth_ratio > F(0)) & (seen.depth_ratio < F(1.0F - kSeenThrough * tolerance));
}

/// What lies behind a thin thing has at most this share of its inverse depth.
constexpr float kBehindThinThing = 0.97F;
constexpr int kThinThingSide = 5;    ///< from the middle of a thin thing to what lies beside it [px]
constexpr int kBesideThinThing = 2;  ///< steps from a pixel to one that may show a thin thing in its place [px]

/// The depth ratio nearest to 1 of another map's pixels within kBesideThinThing of where it sees the point, if one of
/// them agrees; else the one that is there. What is two pixels thin lies beside its place in another map as soon as
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

/// What the other maps say of a pixel.
template <class F>
struct Votes {
  F agree = F(0);           ///< number of maps
  F could_see = F(0);       ///< number of maps whose surface does not hide it, those that agree included
  F weight_for = F(0);      ///< of the maps that agree
  F weight_against = F(0);  ///< of those that have looked through it
  F square_spread = F(0);   ///< sum of squared deviations of the maps that agree
  F square_gain = F(0);     ///< sum of their squared parallax gains

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
  /// `wanted`: maps that must agree; where fewer could see the point, those, but one at least.
  PMSP_HD MaskOf<F> keep(int wanted) const {
    const MaskOf<F> enough = agree >= min(F(static_cast<float>(wanted)), max(could_see, F(1)));
    return wanted == 0 ? enough : enough & (weight_for > weight_against);
  }
};

/// How far a hypothesis lies behind another map's surface: range of its point / range of the surface in that direction
/// - 1, negative in front of it, -1 where the map has no estimate. `inverse_depth` > 0 along the unit `bearing` of the
/// first keyframe.
template <class F, class Map>
PMSP_HD F beyond_surface(const Vec3<F>& bearing, const F& inverse_depth, const Map& other,
                         const Rigid& other_from_first) {
  const Vec3<F> turned = rotate(other_from_first, bearing);
  const Vec3<F> p = fma(inverse_depth, translation(other_from_first, bearing, turned, inverse_depth), turned);
  const IntOf<F> index = pixel_index(p, other.width, other.height);
  return dot(plane_at<F>(other, index), p) / inverse_depth - F(1);
}

}  // namespace pmsp::kernels
