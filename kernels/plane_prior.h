// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "patch.h"
#include "plane.h"

// Planes for surfaces without texture, from the reliable surface around them (in the spirit of ACMP's planar prior, Xu
// and Tao 2020, without a triangulation). The sphere is divided into cells. A cell's support is the most reliable point
// of the depth map that it sees. From a cell without texture one looks along great circles in all directions for the
// first support, and the plane that most of these points lie on is the cell's prior. Three of them that surround the
// cell define it: priors fill in between what is known, they do not extend it.
namespace pmsp::kernels {

constexpr int kPriorDirections = 16;
constexpr int kPriorMinSupports = 7;         ///< of these directions that must lie on the plane
constexpr float kPriorTolerance = 0.02F;     ///< relative distance from the plane up to which they do
constexpr float kPriorReach = 1.4F;          ///< how far supports are looked for [rad]
constexpr float kPriorMinScore = 0.7F;       ///< of a support's pixel
constexpr int kPriorMinNeighbours = 3;       ///< of eight around it that must lie on its plane ...
constexpr float kPriorNeighbourStep = 0.01F;  ///< ... to this relative accuracy

/// Variance of the gray values around a pixel that no linear ramp explains: light that falls off along a wall is no
/// texture.
template <class F, class Cube>
PMSP_HD F ramp_free_variance(const Cube& image, const PatchFrame<F>& frame) {
  F center = sample(image, frame.bearing);
  F sum(0);
  F square(0);
  F across(0);
  F along(0);
  float spread = 0.0F;
  for (int j = 0; j < kPatchSide; ++j) {
    const Vec3<F> left = fma(F(patch_offset(j)), frame.down, frame.bearing);
    for (int i = 0; i < kPatchSide; ++i) {
      const F gray = sample(image, fma(F(patch_offset(i)), frame.right, left)) - center;
      sum = sum + gray;
      square = fma(gray, gray, square);
      across = fma(F(patch_offset(i)), gray, across);
      along = fma(F(patch_offset(j)), gray, along);
      spread += patch_offset(i) * patch_offset(i);
    }
  }
  const F of_ramp = fma(across, across, along * along) * F(1.0F / spread);
  return max(square - sum * sum * F(1.0F / kPatchSamples) - of_ramp, F(0)) * F(1.0F / kPatchSamples);
}

/// A depth map's pixels and what is known of them, in row order.
template <class Map>
struct ReliableMap {
  Map map;  ///< `plane_at` and `score_at`
  const float* variance;
  const float* sin_lon;
  const float* cos_lon;
  const float* sin_lat;
  const float* cos_lat;
  float min_variance;  ///< less is no texture

  PMSP_HD Vec3<float> bearing_at(int x, int y) const {
    return bearing(sin_lon[x], cos_lon[x], sin_lat[y], cos_lat[y]);
  }
};

/// How many pixels two steps around lie on the plane of pixel (x, y).
template <class Map>
PMSP_HD int neighbours_on_plane(const ReliableMap<Map>& m, int x, int y, const Vec3<float>& plane) {
  int count = 0;
  for (int i = 0; i < 9; ++i) {
    const int row = y + 2 * (i / 3 - 1);
    const int column = (x + 2 * (i % 3 - 1) + m.map.width) % m.map.width;
    if (i == 4 || row < 0 || row >= m.map.height) continue;
    const Vec3<float> direction = m.bearing_at(column, row);
    const float there = dot(plane_at<float>(m.map, row * m.map.width + column), direction);
    count += abs(dot(plane, direction) - there) < kPriorNeighbourStep * there ? 1 : 0;
  }
  return count;
}

/// What a cell sees.
struct CellView {
  Vec3<float> support;  ///< (0, 0, 0) = none
  bool plain;           ///< whether it has pixels without texture
};

/// Cell (column, row) of `columns` x `rows`.
template <class Map>
PMSP_HD CellView view_cell(const ReliableMap<Map>& m, int column, int row, int columns, int rows) {
  CellView view{{0.0F, 0.0F, 0.0F}, false};
  float best = kPriorMinScore;
  for (int y = row * m.map.height / rows; y < (row + 1) * m.map.height / rows; ++y) {
    for (int x = column * m.map.width / columns; x < (column + 1) * m.map.width / columns; ++x) {
      const int index = y * m.map.width + x;
      const Vec3<float> plane = plane_at<float>(m.map, index);
      const Vec3<float> direction = m.bearing_at(x, y);
      const float inverse_depth = dot(plane, direction);
      if (!(inverse_depth > 0.0F)) continue;
      const bool textured = m.variance[index] >= m.min_variance;
      view.plain = view.plain || !textured;
      if (!textured || !(score_at(m.map, index) > best)) continue;
      if (neighbours_on_plane(m, x, y, plane) < kPriorMinNeighbours) continue;
      best = score_at(m.map, index);
      view.support = (1.0F / inverse_depth) * direction;
    }
  }
  return view;
}

/// Cells in row order; a support is a point of the surface in the camera frame, (0, 0, 0) where there is none.
struct SupportView {
  const float* x;
  const float* y;
  const float* z;
  int columns, rows;
};

PMSP_HD Vec3<float> support_at(const SupportView& supports, int index) {
  return {supports.x[index], supports.y[index], supports.z[index]};
}

/// The first support in each direction; (0, 0, 0) where there is none within reach.
struct Surroundings {
  Vec3<float> points[kPriorDirections];
  int count;
};

PMSP_HD bool is_point(const Vec3<float>& p) { return dot(p, p) > 0.0F; }

/// Centre of a cell and the directions along its parallel and its meridian.
struct CellFrame {
  Vec3<float> center, right, down;
};
PMSP_HD CellFrame cell_frame(int column, int row, int columns, int rows) {
  const float pi = static_cast<float>(kPi);
  const float lon = ((static_cast<float>(column) + 0.5F) / static_cast<float>(columns) - 0.5F) * 2.0F * pi;
  const float lat = (0.5F - (static_cast<float>(row) + 0.5F) / static_cast<float>(rows)) * pi;
  const float sin_lon = sinf(lon);
  const float cos_lon = cosf(lon);
  const float sin_lat = sinf(lat);
  const float cos_lat = cosf(lat);
  return {bearing(sin_lon, cos_lon, sin_lat, cos_lat), tangent_right(sin_lon, cos_lon),
          tangent_down(sin_lon, cos_lon, sin_lat, cos_lat)};
}

PMSP_HD void look_around(Surroundings& around, const SupportView& supports, const CellFrame& cell) {
  const float step = static_cast<float>(kPi) / static_cast<float>(supports.rows);
  const int steps = static_cast<int>(kPriorReach / step);
  around.count = 0;
  for (int d = 0; d < kPriorDirections; ++d) {
    const float angle = static_cast<float>(2.0 * kPi / kPriorDirections) * static_cast<float>(d);
    const Vec3<float> along = fma(cosf(angle), cell.right, sinf(angle) * cell.down);
    around.points[d] = {0.0F, 0.0F, 0.0F};
    for (int i = 1; i <= steps; ++i) {
      const float t = step * static_cast<float>(i);
      const Vec3<float> direction = fma(cosf(t), cell.center, sinf(t) * along);
      around.points[d] = support_at(supports, pixel_index(direction, supports.columns, supports.rows));
      if (!is_point(around.points[d])) continue;
      ++around.count;
      break;
    }
  }
}

/// How well the surroundings lie on a plane: those within the tolerance, and the sum of what the others and they are
/// off, in tolerances.
struct PlaneSupport {
  int count;
  float cost;
};
PMSP_HD PlaneSupport plane_support(const Surroundings& around, const Vec3<float>& plane) {
  PlaneSupport support{0, 0.0F};
  for (int d = 0; d < kPriorDirections; ++d) {
    if (!is_point(around.points[d])) continue;
    const float off = abs(dot(plane, around.points[d]) - 1.0F) * (1.0F / kPriorTolerance);
    support.count += off < 1.0F ? 1 : 0;
    support.cost += min(off, 1.0F);
  }
  return support;
}

/// The plane through three points; zero where they lie on one with the camera.
PMSP_HD Vec3<float> plane_through(const Vec3<float>& a, const Vec3<float>& b, const Vec3<float>& c) {
  const Vec3<float> ab = cross(a, b);
  const Vec3<float> bc = cross(b, c);
  const Vec3<float> ca = cross(c, a);
  const float volume = dot(a, bc);
  if (volume * volume < 1e-8F * dot(a, a) * dot(b, b) * dot(c, c)) return {0.0F, 0.0F, 0.0F};
  return (1.0F / volume) * (ab + bc + ca);
}

/// Least squares over the surroundings that lie on the plane.
PMSP_HD Vec3<float> refitted(const Surroundings& around, const Vec3<float>& plane) {
  Vec3<float> rows[3] = {};
  Vec3<float> sum{};
  for (int d = 0; d < kPriorDirections; ++d) {
    const Vec3<float>& p = around.points[d];
    if (!is_point(p) || abs(dot(plane, p) - 1.0F) >= kPriorTolerance) continue;
    rows[0] = fma(p.x, p, rows[0]);
    rows[1] = fma(p.y, p, rows[1]);
    rows[2] = fma(p.z, p, rows[2]);
    sum = sum + p;
  }
  const Vec3<float> cofactors = cross(rows[1], rows[2]);
  const float determinant = dot(rows[0], cofactors);
  if (!(determinant > 0.0F)) return plane;
  return (1.0F / determinant) * fma(sum.x, cofactors, fma(sum.y, cross(rows[2], rows[0]), sum.z * cross(rows[0], rows[1])));
}

struct PriorPlane {
  Vec3<float> plane;
  PlaneSupport support;
};

PMSP_HD void consider(PriorPlane& best, const Vec3<float>& plane, const Surroundings& around,
                      const Vec3<float>& center, const PlaneLimits& limits) {
  if (!is_allowed(plane, center, limits)) return;
  const PlaneSupport support = plane_support(around, plane);
  if (support.count < kPriorMinSupports || support.cost >= best.support.cost) return;
  best = {plane, support};
}

/// The plane that best explains the surroundings, of those through three points that surround the cell.
PMSP_HD PriorPlane surrounded_plane(const Surroundings& around, const Vec3<float>& center, const PlaneLimits& limits) {
  constexpr int kWide = kPriorDirections / 2;  // a gap of more, and the cell would lie outside the triangle
  constexpr int kNarrow = 2;
  PriorPlane best{{0.0F, 0.0F, 0.0F}, {0, 1e30F}};
  if (around.count < kPriorMinSupports) return best;
  for (int i = 0; i + 2 * kNarrow < kPriorDirections; ++i) {
    if (!is_point(around.points[i])) continue;
    for (int j = i + kNarrow; j <= i + kWide && j + kNarrow < kPriorDirections; ++j) {
      if (!is_point(around.points[j])) continue;
      for (int k = j + kNarrow; k <= j + kWide && k < kPriorDirections; ++k) {
        const int rest = kPriorDirections + i - k;
        if (rest < kNarrow || rest > kWide || !is_point(around.points[k])) continue;
        consider(best, plane_through(around.points[i], around.points[j], around.points[k]), around, center, limits);
      }
    }
  }
  if (best.support.count > 0) consider(best, refitted(around, best.plane), around, center, limits);
  return best;
}

}  // namespace pmsp::kernels
