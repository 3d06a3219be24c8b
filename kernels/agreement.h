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

template <class F>
struct Agreement {
  F closeness;  ///< range of the point over the range of the other map's surface in its direction; 0 = nothing there
  F implied_depth;  ///< depth along the first keyframe's ray at which it meets the other map's plane
  /// By how much the other camera's direction to the point turns, over the relative change of depth [rad]: small where
  /// there is little parallax.
  F parallax_gain;
  IntOf<F> index;  ///< of that pixel
};

/// `bearing` (unit) and `depth` > 0 in the first keyframe.
template <class F>
PMSP_HD Agreement<F> agreement(const Vec3<F>& bearing, const F& depth, const PlaneMapView& other,
                               const Rigid& other_from_first) {
  const Vec3<F> turned = rotate(other_from_first, bearing);
  const Vec3<F> t = translation<F>(other_from_first);
  const Vec3<F> p = fma(depth, turned, t);
  const Pixel<F> at = project(p, F(static_cast<float>(other.width)), F(static_cast<float>(other.height)));
  const IntOf<F> column_index = column(at.x, other.width);
  const IntOf<F> row_index = row(at.y, other.height);
  const IntOf<F> index = row_index * IntOf<F>(other.width) + column_index;
  const Vec3<F> plane{gather<F>(other.x, index), gather<F>(other.y, index), gather<F>(other.z, index)};
  const F closeness = dot(plane, p);
  const F along_ray = dot(plane, turned);
  const F rest = F(1) - dot(plane, t);
  const auto valid = (closeness > F(0)) & (along_ray > F(0)) & (rest > F(0));
  const Vec3<F> turn = cross(turned, t);
  const F gain = depth * sqrt(dot(turn, turn)) / max(dot(p, p), F(1e-30F));
  return {select(valid, closeness, F(0)), select(valid, rest / select(valid, along_ray, F(1)), F(0)), gain, index};
}

}  // namespace pmsp::kernels
