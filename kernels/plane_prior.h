// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"
#include "patch.h"
#include "plane.h"
#include "stage.h"

// Planes for surfaces without texture, through the reliable surface around them (what ACMP's planar prior is for, Xu
// and Tao 2020, but without a triangulation). The sphere is divided into cells. A cell's support is the most reliable
// point of the depth map that it sees. From cells that have pixels without texture one looks along great circles in all
// directions for the first support; the plane that most of what one finds lies on is the cell's prior. Three supports
// that surround the cell define it: priors fill in between what is known, they do not extend it. A cell's functions are
// branchy and therefore in plain floats; there are few cells. Where no plane is found, a depth image from elsewhere may
// give one (Keyframe::prior_depth), if the reliable surface around agrees with it.
namespace pmsp::kernels {

constexpr int kPriorColumns = 160;          ///< of cells, at most
constexpr int kPriorDirections = 16;        ///< in which supports are looked for
constexpr float kPriorReach = 1.4F;         ///< how far [rad]: to the ends of a room's ceiling
constexpr int kPriorMinSupports = 5;        ///< that must lie on the plane
constexpr float kPriorTolerance = 0.02F;    ///< relative distance up to which they do
constexpr float kSupportMinScore = 0.7F;    ///< of a support's pixel
constexpr int kSupportMinNeighbours = 3;    ///< of the eight around it that must lie on its plane ...
constexpr float kSupportTolerance = 0.01F;  ///< ... up to this relative distance: along an edge they do
constexpr float kTexturePixels = 1.2F;      ///< distance of the samples by which texture is judged
constexpr int kGivenMinSupports = 3;        ///< around a cell whose given plane is to be corrected
constexpr float kGivenTolerance = 0.1F;     ///< relative distance up to which corrected planes agree with supports
constexpr float kGivenMinShare = 0.6F;      ///< of the supports, the near ones counting more, that must agree
constexpr int kToldMinSupports = 4;         ///< that must lie on a plane which agrees with the given one
constexpr float kToldTolerance = 0.08F;     ///< relative distance up to which it does
constexpr float kToldMinCos = 0.9F;         ///< of the angle between their normals
constexpr float kGivenCoplanar = 0.05F;     ///< relative distance up to which a support lies on the cell's plane

/// Variance of the gray values around a pixel that no linear ramp explains: light that falls off along a wall is no
/// texture.
template <class F, class Cube>
PMSP_HD F ramp_free_variance(const Cube& image, const PatchFrame<F>& frame) {
  const F center = sample(image, frame.bearing);
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

/// The first support in each direction; (0, 0, 0) where there is none within reach.
struct Surroundings {
  Vec3<float> points[kPriorDirections];
  int count;
};

/// A cell's prior; the zero plane = none.
struct PriorPlane {
  Vec3<float> plane;
  int supports;  ///< that lie on it
  float cost;    ///< how far all are off: sum of distances, in tolerances, each at most 1
};

/// All cells, in row order, and what they are made from. `Map`: the depth map so far, with `width`, `height`,
/// `plane_at` and `score_at`.
template <class Map>
struct PriorCells {
  Map map;
  GridView grid;          ///< of the map
  const float* variance;  ///< ramp_free_variance of the map's pixels
  float min_variance;     ///< less is no texture
  PlaneLimits limits;
  int columns, rows;
  const int* looks;            ///< where one gets from a row's first cell: index of the cell, [row][direction][step]
  const Vec3<float>* given;    ///< planes of the cells that are known from elsewhere, 0 = none; nullptr = of no cell
  Vec3<float>* supports;       ///< points of the surface; (0, 0, 0) = none
  unsigned char* textureless;  ///< whether a cell has pixels without texture
  Surroundings* around;
  PriorPlane* found;   ///< from each cell alone
  PriorPlane* chosen;  ///< from its neighbours' too

  PMSP_HD Vec3<float> bearing_at(int x, int y) const { return kernels::bearing_at<float>(grid, x, y); }
};

PMSP_HD bool is_point(const Vec3<float>& p) { return dot(p, p) > 0.0F; }

/// How many pixels two steps around lie on the plane of pixel (x, y).
template <class Map>
PMSP_HD int neighbours_on_plane(const PriorCells<Map>& cells, int x, int y, const Vec3<float>& plane) {
  int count = 0;
  for (int i = 0; i < 9; ++i) {
    const int row = y + 2 * (i / 3 - 1);
    const int column = (x + 2 * (i % 3 - 1) + cells.map.width) % cells.map.width;
    if (i == 4 || row < 0 || row >= cells.map.height) continue;
    const Vec3<float> direction = cells.bearing_at(column, row);
    const float there = dot(plane_at<float>(cells.map, row * cells.map.width + column), direction);
    count += abs(dot(plane, direction) - there) < kSupportTolerance * there ? 1 : 0;
  }
  return count;
}

/// Writes `supports` and `textureless` of a cell.
template <class Map>
PMSP_HD void find_support(const PriorCells<Map>& cells, int column, int row) {
  Vec3<float> support{0.0F, 0.0F, 0.0F};
  bool textureless = false;
  float best = kSupportMinScore;
  const int y1 = (row + 1) * cells.map.height / cells.rows;
  const int x1 = (column + 1) * cells.map.width / cells.columns;
  for (int y = row * cells.map.height / cells.rows; y < y1; ++y) {
    for (int x = column * cells.map.width / cells.columns; x < x1; ++x) {
      const int index = y * cells.map.width + x;
      const Vec3<float> plane = plane_at<float>(cells.map, index);
      const Vec3<float> direction = cells.bearing_at(x, y);
      const float inverse_depth = dot(plane, direction);
      if (!(inverse_depth > 0.0F)) continue;
      const bool textured = cells.variance[index] >= cells.min_variance;
      textureless = textureless || !textured;
      if (!textured || !(score_at<float>(cells.map, index) > best)) continue;
      if (neighbours_on_plane(cells, x, y, plane) < kSupportMinNeighbours) continue;
      best = score_at<float>(cells.map, index);
      support = (1.0F / inverse_depth) * direction;
    }
  }
  cells.supports[row * cells.columns + column] = support;
  cells.textureless[row * cells.columns + column] = textureless ? 1 : 0;
}

/// How many steps of one row of cells one looks along a great circle.
PMSP_HD int look_steps(int rows) {
  return static_cast<int>(kPriorReach / static_cast<float>(kPi) * static_cast<float>(rows));
}

template <class Map>
PMSP_HD void look_around(Surroundings& around, const PriorCells<Map>& cells, int column, int row) {
  const int steps = look_steps(cells.rows);
  const int* look = cells.looks + row * kPriorDirections * steps;
  around.count = 0;
  for (int d = 0; d < kPriorDirections; ++d) {
    around.points[d] = {0.0F, 0.0F, 0.0F};
    for (int i = 0; i < steps; ++i) {
      const int first = look[d * steps + i];
      const bool beyond = first % cells.columns + column >= cells.columns;
      const Vec3<float>& support = cells.supports[first + column - (beyond ? cells.columns : 0)];
      if (!is_point(support)) continue;
      around.points[d] = support;
      ++around.count;
      break;
    }
  }
}

/// Takes the plane if it explains the surroundings better.
PMSP_HD void consider(PriorPlane& best, const Vec3<float>& plane, const Surroundings& around,
                      const Vec3<float>& bearing, const PlaneLimits& limits, int min_supports = kPriorMinSupports) {
  if (!is_allowed(plane, bearing, limits)) return;
  PriorPlane candidate{plane, 0, 0.0F};
  for (int d = 0; d < kPriorDirections; ++d) {
    if (!is_point(around.points[d])) continue;
    const float off = abs(dot(plane, around.points[d]) - 1.0F) * (1.0F / kPriorTolerance);
    candidate.supports += off < 1.0F ? 1 : 0;
    candidate.cost += min(off, 1.0F);
  }
  if (candidate.supports >= min_supports && candidate.cost < best.cost) best = candidate;
}

/// The plane through three points; zero where they lie on one with the camera.
PMSP_HD Vec3<float> plane_through(const Vec3<float>& a, const Vec3<float>& b, const Vec3<float>& c) {
  const Vec3<float> bc = cross(b, c);
  const float volume = dot(a, bc);
  if (volume * volume <= 1e-8F * dot(a, a) * dot(b, b) * dot(c, c)) return {0.0F, 0.0F, 0.0F};
  return (1.0F / volume) * (cross(a, b) + bc + cross(c, a));
}

/// Least squares over those of the surroundings that lie on the plane.
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
  const Vec3<float> scaled =
      fma(sum.x, cofactors, fma(sum.y, cross(rows[2], rows[0]), sum.z * cross(rows[0], rows[1])));
  return (1.0F / determinant) * scaled;
}

/// Bearing of the centre of a cell.
PMSP_HD Vec3<float> cell_bearing(int column, int row, int columns, int rows) {
  const float pi = static_cast<float>(kPi);
  const float lon = ((static_cast<float>(column) + 0.5F) / static_cast<float>(columns) - 0.5F) * 2.0F * pi;
  const float lat = (0.5F - (static_cast<float>(row) + 0.5F) / static_cast<float>(rows)) * pi;
  return bearing(sinf(lon), cosf(lon), sinf(lat), cosf(lat));
}

/// Writes `around` and `found` of a cell: of the planes through three supports that surround it, the one that explains
/// the surroundings best.
template <class Map>
PMSP_HD void find_plane(const PriorCells<Map>& cells, int column, int row) {
  constexpr int kWide = kPriorDirections / 2;  // a wider gap, and the cell would lie outside the triangle
  constexpr int kNarrow = 3;                   // a narrower one makes no good triangle
  const int cell = row * cells.columns + column;
  PriorPlane best{{0.0F, 0.0F, 0.0F}, 0, static_cast<float>(kPriorDirections)};
  Surroundings& around = cells.around[cell];
  around.count = 0;
  if (cells.textureless[cell] != 0) look_around(around, cells, column, row);
  if (around.count >= kPriorMinSupports) {
    const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
    for (int i = 0; i + 2 * kNarrow < kPriorDirections; ++i) {
      for (int j = i + kNarrow; j <= i + kWide && j + kNarrow < kPriorDirections; ++j) {
        for (int k = j + kNarrow; k <= j + kWide && k < kPriorDirections; ++k) {
          const int rest = kPriorDirections + i - k;
          if (rest < kNarrow || rest > kWide) continue;
          const Vec3<float>& a = around.points[i];
          const Vec3<float>& b = around.points[j];
          const Vec3<float>& c = around.points[k];
          if (!is_point(a) || !is_point(b) || !is_point(c)) continue;
          consider(best, plane_through(a, b, c), around, center, cells.limits);
        }
      }
    }
    if (best.supports > 0) consider(best, refitted(around, best.plane), around, center, cells.limits);
  }
  cells.found[cell] = best;
}

/// How much a support says about a cell: the nearer, the more.
PMSP_HD float support_weight(const Vec3<float>& p, const Vec3<float>& center) {
  return 1.0F / (max(1.0F - dot(center, p) / sqrt(dot(p, p)), 0.0F) + 0.002F);
}

/// By what the given plane at a support must be multiplied to reach it; 0 = there is none.
template <class Map>
PMSP_HD float given_ratio(const PriorCells<Map>& cells, const Vec3<float>& p) {
  const float told = dot(cells.given[pixel_index(p, cells.columns, cells.rows)], p);
  return told > 0.0F ? 1.0F / told : 0.0F;
}

/// Mean of the ratios around a cell that differ from `from` by less than `tolerance`, and the share of those.
struct GivenRatio {
  float ratio;
  float share;
  int count;
};
template <class Map>
PMSP_HD GivenRatio mean_ratio(const PriorCells<Map>& cells, const Surroundings& around, const Vec3<float>& center,
                              float from, float tolerance) {
  GivenRatio mean{0.0F, 0.0F, 0};
  float all = 0.0F;
  for (int d = 0; d < kPriorDirections; ++d) {
    const Vec3<float>& p = around.points[d];
    const float ratio = is_point(p) ? given_ratio(cells, p) : 0.0F;
    if (!(ratio > 0.0F)) continue;
    const float weight = support_weight(p, center);
    all += weight;
    if (!(abs(ratio - from) < tolerance * from)) continue;
    mean.ratio += weight * ratio;
    mean.share += weight;
    ++mean.count;
  }
  if (mean.count == 0) return mean;
  mean.ratio *= 1.0F / mean.share;
  mean.share *= 1.0F / all;
  return mean;
}

/// Moves a plane so that it passes through the supports that nearly lie on it, by no more than they can tell.
PMSP_HD Vec3<float> through_supports(const Vec3<float>& plane, const Surroundings& around) {
  Vec3<float> rows[3] = {};
  Vec3<float> sum{};
  float squares = 0.0F;
  for (int d = 0; d < kPriorDirections; ++d) {
    const Vec3<float>& p = around.points[d];
    if (!is_point(p)) continue;
    const float off = 1.0F - dot(plane, p);
    if (abs(off) >= kGivenCoplanar) continue;
    rows[0] = fma(p.x, p, rows[0]);
    rows[1] = fma(p.y, p, rows[1]);
    rows[2] = fma(p.z, p, rows[2]);
    sum = fma(off, p, sum);
    squares += dot(p, p);
  }
  const float hold = 0.02F * squares;  // against turning where supports lie in a line
  rows[0].x += hold;
  rows[1].y += hold;
  rows[2].z += hold;
  const Vec3<float> cofactors = cross(rows[1], rows[2]);
  const float determinant = dot(rows[0], cofactors);
  if (!(determinant > 0.0F)) return plane;
  const Vec3<float> move = fma(sum.x, cofactors, fma(sum.y, cross(rows[2], rows[0]), sum.z * cross(rows[0], rows[1])));
  return fma(1.0F / determinant, move, plane);
}

/// A cell's given plane, corrected by what the reliable surface around says of the given planes there. Zero where that
/// does not agree with them.
template <class Map>
PMSP_HD Vec3<float> corrected_given(const PriorCells<Map>& cells, int column, int row) {
  const Vec3<float> none{0.0F, 0.0F, 0.0F};
  const int cell = row * cells.columns + column;
  const Vec3<float> given = cells.given[cell];
  const Surroundings& around = cells.around[cell];
  if (!is_point(given) || around.count < kGivenMinSupports) return none;
  const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
  const GivenRatio all = mean_ratio(cells, around, center, 1.0F, 1e6F);
  if (all.count < kGivenMinSupports) return none;
  const GivenRatio agreed = mean_ratio(cells, around, center, all.ratio, kGivenTolerance);
  if (agreed.count < kGivenMinSupports || agreed.share < kGivenMinShare) return none;
  const Vec3<float> plane = through_supports(agreed.ratio * given, around);
  return is_allowed(plane, center, cells.limits) ? plane : none;
}

/// The plane that four or more of the supports lie on, wherever they are, and that agrees with what is given: the given
/// plane tells which supports belong to the cell's surface, these tell where that is. Zero where there is none.
/// `told`: corrected_given, not zero.
template <class Map>
PMSP_HD Vec3<float> told_plane(const PriorCells<Map>& cells, int column, int row, const Vec3<float>& told) {
  const Surroundings& around = cells.around[row * cells.columns + column];
  const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
  PriorPlane best{{0.0F, 0.0F, 0.0F}, 0, static_cast<float>(kPriorDirections)};
  const float there = dot(told, center);
  const auto agrees = [&](const Vec3<float>& plane) {
    const float along = dot(plane, told);
    return abs(dot(plane, center) - there) < kToldTolerance * there && along > 0.0F &&
           along * along > kToldMinCos * kToldMinCos * dot(plane, plane) * dot(told, told);
  };
  for (int i = 0; i < kPriorDirections; ++i) {
    for (int j = i + 1; j < kPriorDirections; ++j) {
      for (int k = j + 1; k < kPriorDirections; ++k) {
        const Vec3<float>& a = around.points[i];
        const Vec3<float>& b = around.points[j];
        const Vec3<float>& c = around.points[k];
        if (!is_point(a) || !is_point(b) || !is_point(c)) continue;
        const Vec3<float> plane = plane_through(a, b, c);
        if (agrees(plane)) consider(best, plane, around, center, cells.limits, kToldMinSupports);
      }
    }
  }
  if (best.supports == 0) return best.plane;
  const Vec3<float> plane = refitted(around, best.plane);
  return agrees(plane) && is_allowed(plane, center, cells.limits) ? plane : best.plane;
}

/// Writes `chosen` of a cell: its own plane, or that of a cell beside it if that explains the surroundings better.
/// Where there is none: one that agrees with the given one, or else that.
template <class Map>
PMSP_HD void choose_plane(const PriorCells<Map>& cells, int column, int row) {
  const int cell = row * cells.columns + column;
  PriorPlane best = cells.found[cell];
  if (cells.around[cell].count >= kPriorMinSupports) {
    const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
    for (int i = 0; i < 9; ++i) {
      const int other_row = row + i / 3 - 1;
      const int other_column = (column + i % 3 - 1 + cells.columns) % cells.columns;
      if (other_row < 0 || other_row >= cells.rows) continue;
      const PriorPlane& other = cells.found[other_row * cells.columns + other_column];
      if (other.supports > 0) consider(best, other.plane, cells.around[cell], center, cells.limits);
    }
  }
  if (best.supports == 0 && cells.given != nullptr) {
    const Vec3<float> told = corrected_given(cells, column, row);
    best.plane = is_point(told) ? told_plane(cells, column, row, told) : told;
    if (!is_point(best.plane)) best.plane = told;
  }
  cells.chosen[cell] = best;
}

/// What is found for all cells, one after the other.
enum class PriorStep { kSupports, kPlanes, kChoice };

/// One of the steps; a stage over the cells.
template <class Map, PriorStep step>
struct PriorCellStep {
  static constexpr int kCounts = 0;

  PriorCells<Map> cells;

  PMSP_HD int width() const { return cells.columns; }
  PMSP_HD int height() const { return cells.rows; }

  PMSP_HD void operator()(const Place<float>& at, bool* /*counted*/) const {
    if constexpr (step == PriorStep::kSupports) find_support(cells, at.column, at.row);
    if constexpr (step == PriorStep::kPlanes) find_plane(cells, at.column, at.row);
    if constexpr (step == PriorStep::kChoice) choose_plane(cells, at.column, at.row);
  }
};

/// The prior of a pixel of the map; zero = none.
template <class Map>
PMSP_HD Vec3<float> prior_at(const PriorCells<Map>& cells, int x, int y) {
  const int index = y * cells.map.width + x;
  const bool textureless = cells.variance[index] < cells.min_variance && is_point(plane_at<float>(cells.map, index));
  if (!textureless) return {0.0F, 0.0F, 0.0F};
  return cells.chosen[y * cells.rows / cells.map.height * cells.columns + x * cells.columns / cells.map.width].plane;
}

/// How much texture there is around each pixel; a stage.
template <class Machine>
struct TextureVariance {
  static constexpr int kCounts = 0;

  typename Machine::Cube image;
  GridView grid;
  float spacing;    ///< of the samples (tangent of the angle)
  float* variance;  ///< [gray levels squared]

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* /*counted*/) const {
    const PatchFrame<F> frame = patch_frame(gather<F>(grid.sin_lon, at.column), gather<F>(grid.cos_lon, at.column),
                                            F(grid.sin_lat[at.row]), F(grid.cos_lat[at.row]), F(spacing));
    store<F>(ramp_free_variance(image, frame), variance + at.first, at.count);
  }
};

/// The priors of the pixels; a stage.
template <class Machine>
struct PixelPriors {
  static constexpr int kCounts = 0;

  PriorCells<typename Machine::Map> cells;
  typename Machine::Planes to;  ///< without scores

  PMSP_HD int width() const { return cells.map.width; }
  PMSP_HD int height() const { return cells.map.height; }

  PMSP_HD void operator()(const Place<float>& at, bool* /*counted*/) const {
    put(to, static_cast<std::size_t>(at.first), 1, Hypothesis<float>{prior_at(cells, at.column, at.row), 0.0F});
  }
};

}  // namespace pmsp::kernels
