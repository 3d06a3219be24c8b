// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "grid_view.h"
#include "stage.h"
#include "surfel.h"

// The wide planes that a keyframe sees: floor, ceiling, walls. A plane is laid through the points of each field of the
// sphere; those are kept that most of the sphere lies on.
namespace pmsp::kernels {

constexpr int kFieldColumns = 16;  ///< of fields
constexpr int kFieldRows = 8;
constexpr int kFields = kFieldColumns * kFieldRows;
constexpr int kFieldSide = 20;             ///< points of a field that a plane is laid through, squared
constexpr float kLeastOfField = 0.3F;      ///< share of them that there must be, and that must lie on it
constexpr float kOnPlane = 0.01F;          ///< relative deviation up to which they do
constexpr int kSphereRows = 32;            ///< of the lattice on which a plane's share of the sphere is counted
constexpr float kLeastOfSphere = 0.02F;    ///< that share, at least
constexpr float kOnePlaneCos = 0.97F;      ///< cosine of the normals up to which two planes are one ...
constexpr float kOnePlaneDistance = 0.1F;  ///< ... and relative difference of their distances
constexpr int kWidePlanes = 4;             ///< of a keyframe, at most

/// A plane v: v · X = 1 for its points X. In the keyframe's frame; 0 = none.
struct WidePlane {
  Vec3<float> plane;
  float support;  ///< share of the sphere that lies on it
};

/// The keyframe's point at a pixel; 0 = none.
PMSP_HD Vec3<float> surfel_point(const std::uint32_t* surfels, const GridView& grid, int column, int row) {
  return depth_of_surfel<float>(surfels[row * grid.width + column]) * bearing_at<float>(grid, column, row);
}

PMSP_HD float off_plane(const Vec3<float>& plane, const Vec3<float>& point) { return abs(dot(plane, point) - 1.0F); }

/// A plane for each field; a stage over the fields. Least squares of what is not too far from the plane before.
struct FindWidePlanes {
  static constexpr int kCounts = 0;

  const std::uint32_t* surfels;
  GridView grid;
  WidePlane* found;

  PMSP_HD int width() const { return kFieldColumns; }
  PMSP_HD int height() const { return kFieldRows; }

  PMSP_HD void operator()(const Place<float>& at, bool* /*counted*/) const {
    constexpr float kFar[] = {1e30F, 0.2F, 0.05F, 0.02F};
    constexpr float kWanted = kLeastOfField * kFieldSide * kFieldSide;
    Vec3<float> plane{0.0F, 0.0F, 0.0F};
    float on = 0.0F;
    for (const float far : kFar) {
      const Fit fit = fit_of(at, plane, far);
      if (fit.count < kWanted) return put(at, {{0.0F, 0.0F, 0.0F}, 0.0F});
      plane = solved(fit);
    }
    for (int i = 0; i < kFieldSide * kFieldSide; ++i) {
      const Vec3<float> point = field_point(at, i);
      on += dot(point, point) > 0.0F && off_plane(plane, point) < kOnPlane ? 1.0F : 0.0F;
    }
    put(at, on < kWanted ? WidePlane{{0.0F, 0.0F, 0.0F}, 0.0F} : WidePlane{plane, share_on(plane)});
  }

 private:
  /// Sums of the products of coordinates, and of coordinates, in units of `unit`.
  struct Fit {
    float xx, xy, xz, yy, yz, zz;
    Vec3<float> sum;
    float count, unit;
  };

  PMSP_HD void put(const Place<float>& at, const WidePlane& plane) const { found[at.index] = plane; }

  PMSP_HD Vec3<float> field_point(const Place<float>& at, int i) const {
    const int column = (at.column * kFieldSide + i % kFieldSide) * grid.width / (kFieldColumns * kFieldSide);
    const int row = (at.row * kFieldSide + i / kFieldSide) * grid.height / (kFieldRows * kFieldSide);
    return surfel_point(surfels, grid, column, row);
  }

  PMSP_HD Fit fit_of(const Place<float>& at, const Vec3<float>& before, float far) const {
    Fit fit{};
    for (int i = 0; i < kFieldSide * kFieldSide; ++i) {
      Vec3<float> point = field_point(at, i);
      const float square = dot(point, point);
      if (!(square > 0.0F) || !(off_plane(before, point) < far)) continue;
      if (fit.count == 0.0F) fit.unit = sqrt(square);
      point = (1.0F / fit.unit) * point;
      fit.xx = fma(point.x, point.x, fit.xx);
      fit.xy = fma(point.x, point.y, fit.xy);
      fit.xz = fma(point.x, point.z, fit.xz);
      fit.yy = fma(point.y, point.y, fit.yy);
      fit.yz = fma(point.y, point.z, fit.yz);
      fit.zz = fma(point.z, point.z, fit.zz);
      fit.sum = fit.sum + point;
      fit.count += 1.0F;
    }
    return fit;
  }

  PMSP_HD static Vec3<float> solved(const Fit& fit) {
    const Vec3<float> x{fit.xx, fit.xy, fit.xz};
    const Vec3<float> y{fit.xy, fit.yy, fit.yz};
    const Vec3<float> z{fit.xz, fit.yz, fit.zz};
    const Vec3<float> yz = cross(y, z);
    const float determinant = dot(x, yz) * fit.unit;
    if (!(determinant > 0.0F)) return {0.0F, 0.0F, 0.0F};
    return (1.0F / determinant) * (fit.sum.x * yz + fit.sum.y * cross(z, x) + fit.sum.z * cross(x, y));
  }

  PMSP_HD float share_on(const Vec3<float>& plane) const {
    float on = 0.0F;
    float all = 0.0F;
    for (int i = 0; i < kSphereRows; ++i) {
      const int row = (2 * i + 1) * grid.height / (2 * kSphereRows);
      const float weight = grid.cos_lat[row];
      for (int k = 0; k < 2 * kSphereRows; ++k) {
        const Vec3<float> point = surfel_point(surfels, grid, (2 * k + 1) * grid.width / (4 * kSphereRows), row);
        on += off_plane(plane, point) < kOnPlane ? weight : 0.0F;
        all += weight;
      }
    }
    return on / all;
  }
};

PMSP_HD bool is_one_plane(const Vec3<float>& a, const Vec3<float>& b) {
  const float length_a = sqrt(dot(a, a));
  const float length_b = sqrt(dot(b, b));
  return dot(a, b) > kOnePlaneCos * length_a * length_b &&
         abs(length_a - length_b) < kOnePlaneDistance * max(length_a, length_b);
}

/// The planes that most lies on, each once; a stage of one pixel.
struct ChooseWidePlanes {
  static constexpr int kCounts = 0;

  const WidePlane* found;
  WidePlane* chosen;  ///< kWidePlanes

  PMSP_HD int width() const { return 1; }
  PMSP_HD int height() const { return 1; }

  PMSP_HD void operator()(const Place<float>& /*at*/, bool* /*counted*/) const {
    for (int m = 0; m < kWidePlanes; ++m) {
      WidePlane best{{0.0F, 0.0F, 0.0F}, kLeastOfSphere};
      for (int i = 0; i < kFields; ++i) {
        bool is_new = found[i].support > best.support;
        for (int other = 0; other < m && is_new; ++other) is_new = !is_one_plane(found[i].plane, chosen[other].plane);
        if (is_new) best = found[i];
      }
      chosen[m] = best;
    }
  }
};

PMSP_HD bool is_plane(const WidePlane& plane) { return dot(plane.plane, plane.plane) > 0.0F; }

template <class F>
PMSP_HD Vec3<F> plane_of(const WidePlane& plane) {
  return {F(plane.plane.x), F(plane.plane.y), F(plane.plane.z)};
}

}  // namespace pmsp::kernels
