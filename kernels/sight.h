// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "vec3.h"

// What a keyframe's depth map says of a point of another one: it has the point on its surface, it has looked through
// the point at something farther away, or it says nothing (the point is hidden, or the direction has no depth).
namespace pmsp::kernels {

/// How far a keyframe has seen, in cells of several pixels, in row order.
struct SightView {
  const float* nearest;   ///< smallest depth in the cell, 0 = none known
  const float* farthest;  ///< largest depth
  int width, height;
};

struct SightLimits {
  float min_through;  ///< range over nearest depth below which a point has been looked through, below min_near
  float min_near;     ///< from here on it lies on the surface,
  float max_far;      ///< up to this range over farthest depth
};

/// A view's say: the inverse square of its distance, because errors at edges are as wide as a patch and so grow with
/// distance. At most one of the two is not zero.
template <class F>
struct Sight {
  F on_surface;
  F through;
};

/// `point` in the first keyframe, not the place of the other camera.
template <class F>
PMSP_HD Sight<F> sight(const Vec3<F>& point, const SightView& other, const Rigid& other_from_first,
                       const SightLimits& limits) {
  const Vec3<F> p = transform(other_from_first, point);
  const F square = dot(p, p);
  const F range = sqrt(square);
  const IntOf<F> index = pixel_index(p, other.width, other.height);
  const F nearest = gather<F>(other.nearest, index);
  const F farthest = gather<F>(other.farthest, index);
  const auto on_surface = (range >= nearest * F(limits.min_near)) & (range <= farthest * F(limits.max_far));
  const auto through = range < nearest * F(limits.min_through);  // false where nothing is known
  const F weight = F(1) / max(square, F(1e-30F));
  return {select(on_surface, weight, F(0)), select(through, weight, F(0))};
}

}  // namespace pmsp::kernels
