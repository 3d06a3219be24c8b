// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "elementary.h"
#include "random.h"
#include "rigid.h"
#include "vec3.h"

// A hypothesis is a plane, stored as the vector v with v . X = 1 for all its points X (camera frame). The range along a
// unit bearing b is 1 / (v . b); the unit normal that faces the camera is -v / |v|. One vector per pixel thus holds
// depth and normal, and a neighbour's plane can be used without conversion. The zero vector means "no plane". Surfaces
// too far for parallax, such as the sky, have far planes with an inverse depth below kFarLimit; they yield no points,
// and lie behind everything else.
namespace pmsp::kernels {

/// Inverse depth of far planes, in any unit: rotation and scaling do not underflow.
constexpr float kFarInverseDepth = 1e-12F;
/// Upper limit for far planes, lower limit for others.
constexpr float kFarLimit = 1e-9F;

/// Far plane of a pixel.
template <class F>
PMSP_HD Vec3<F> far_plane(const Vec3<F>& bearing) {
  return F(kFarInverseDepth) * bearing;
}

template <class F>
PMSP_HD MaskOf<F> is_far(const F& inverse_depth) {
  return (inverse_depth > F(0)) & (inverse_depth < F(kFarLimit));
}

/// Limits of a pixel's planes.
struct PlaneLimits {
  float min_inverse_depth;  ///< 1 / largest depth
  float max_inverse_depth;  ///< 1 / smallest depth
  float min_cos2_slant;     ///< squared cosine of the largest angle between normal and ray
};

template <class F>
PMSP_HD MaskOf<F> is_allowed(const Vec3<F>& plane, const Vec3<F>& bearing, const PlaneLimits& limits) {
  const F inverse_depth = dot(plane, bearing);
  return ((inverse_depth >= F(limits.min_inverse_depth)) | is_far(inverse_depth)) &
         (inverse_depth <= F(limits.max_inverse_depth)) &
         (inverse_depth * inverse_depth >= F(limits.min_cos2_slant) * dot(plane, plane));
}

/// Plane through the point of this inverse depth. `normal`: of any length, facing the camera: normal . bearing < 0.
template <class F>
PMSP_HD Vec3<F> plane_from(const F& inverse_depth, const Vec3<F>& normal, const Vec3<F>& bearing) {
  return (inverse_depth / dot(normal, bearing)) * normal;
}

template <class F>
PMSP_HD Vec3<F> random_offset(const RandomKey& key, const UIntOf<F>& pixel, std::uint32_t draw) {
  return {uniform_signed<F>(key, pixel, draw), uniform_signed<F>(key, pixel, draw + 1),
          uniform_signed<F>(key, pixel, draw + 2)};
}

/// Random plane: depth log-uniform between the limits, normal within about 60 degrees of the ray. Draws 0 to 3.
template <class F>
PMSP_HD Vec3<F> random_plane(const RandomKey& key, const UIntOf<F>& pixel, std::uint32_t draw, const Vec3<F>& bearing,
                             const PlaneLimits& limits, float log_depth_span) {
  const F inverse_depth = F(limits.min_inverse_depth) * kernels::exp(uniform<F>(key, pixel, draw) * F(log_depth_span));
  const Vec3<F> normal = F(0.85F) * random_offset<F>(key, pixel, draw + 1) - F(1.2F) * bearing;
  const auto facing = dot(normal, bearing) < F(-0.2F);
  return plane_from(inverse_depth, select(facing, normal, F(-1) * bearing), bearing);
}

/// Random change of a plane: inverse depth by a relative step of at most `depth_step`, unit normal by at most
/// `normal_step` along each axis. Draws 0 to 3.
template <class F>
PMSP_HD Vec3<F> perturbed(const Vec3<F>& plane, const RandomKey& key, const UIntOf<F>& pixel, std::uint32_t draw,
                          const Vec3<F>& bearing, const F& depth_step, const F& normal_step) {
  const F inverse_depth = dot(plane, bearing) * fma(depth_step, uniform_signed<F>(key, pixel, draw), F(1));
  const Vec3<F> normal = fma(normal_step, random_offset<F>(key, pixel, draw + 1), F(-1) * normalized(plane));
  const auto facing = dot(normal, bearing) < F(-0.05F);
  return plane_from(inverse_depth, select(facing, normal, F(-1) * bearing), bearing);
}

/// Plane of another camera's frame in this one: v . (R X + t) = 1 becomes (R^T v) . X = 1 - v . t. Zero if the camera
/// lies on the plane or behind it. From centre to centre, without lenses: accurate enough for initial planes.
template <class F>
PMSP_HD Vec3<F> moved_plane(const Vec3<F>& plane, const Rigid& from_here) {
  const F rest = F(1) - dot(plane, translation<F>(from_here));
  const auto valid = rest > F(1e-6F);
  return select(valid, F(1) / select(valid, rest, F(1)), F(0)) * rotate_back(from_here, plane);
}

}  // namespace pmsp::kernels
