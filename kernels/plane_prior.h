// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "depth_evidence.h"
#include "equirect.h"
#include "patch.h"
#include "plane.h"
#include "stage.h"

// Prior planes for surfaces without texture, from the reliable surface around them (after ACMP's planar prior, Xu and
// Tao 2020, but without a triangulation). The sphere is divided into cells. A cell's support is the point of its depth
// map with the best image evidence. For cells with uncertain pixels, the first support is searched along great circles
// in all directions; the plane that explains these supports best, fitted to them or adopted from another cell, is the
// cell's prior plane. Three supports that surround a cell define a fitted plane: priors interpolate between known
// surfaces, they do not extrapolate. Functions of cells branch, and therefore use plain floats; cells are few. If no
// plane is found, prior depth may provide one (Keyframe::prior_depth), provided that it agrees with the
// reliable surface around.
namespace pmsp::kernels {

constexpr int kPriorColumns = 160;           ///< maximum number of columns of cells
constexpr int kPriorDirections = 16;         ///< directions of the search for supports
constexpr float kPriorReach = 1.4F;          ///< distance of the search [rad]: to the ends of a room's ceiling
constexpr int kPriorMinSupports = 5;         ///< minimum number of supports on the plane
constexpr float kPriorTolerance = 0.02F;     ///< maximum relative distance of these, plus twice their own error ...
constexpr float kMaxPriorTolerance = 0.06F;  ///< ... up to this maximum
/// Cost of a support in front of the plane, relative to one behind: occluding objects are expected, surfaces behind a
/// wall are visible only beyond its ends.
constexpr float kOccluderCost = 0.6F;
constexpr float kSupportMinScore = 0.7F;   ///< minimum score of a support's pixel
constexpr float kSupportMaxError = 0.04F;  ///< maximum relative error of its depth (matching_error)
constexpr float kMinSupportError = 0.01F;  ///< minimum error in comparisons
constexpr float kSupportTexture = 0.75F;   ///< minimum common variance of its patches, over that of a textured patch
constexpr float kCommonSupportError = 0.003F;  ///< relative error that supports have in common
constexpr float kMaxCertainError = 0.02F;      ///< relative error above which a pixel is uncertain
constexpr int kSupportMinNeighbours = 3;       ///< minimum number of the eight pixels around a support on its plane ...
constexpr float kSupportTolerance = 0.01F;     ///< ... up to this relative distance; fulfilled along an edge
constexpr float kTexturePixels = 1.2F;         ///< distance of the samples that measure texture [px]
constexpr int kPriorDepthMinSupports =
    3;  ///< minimum number of supports around a cell to correct its prior depth plane
constexpr float kPriorDepthTolerance =
    0.1F;                                    ///< maximum relative deviation of corrected prior depth planes at supports
constexpr float kPriorDepthMinShare = 0.6F;  ///< minimum share of agreeing supports, weighted by proximity
constexpr int kAgreeingMinSupports =
    4;  ///< minimum number of supports on a plane that agrees with that of the prior depth
constexpr float kAgreeingTolerance = 0.08F;  ///< maximum relative distance of such a plane from that of the prior depth
constexpr float kAgreeingMinCos = 0.9F;      ///< minimum cosine between their normals
constexpr float kPriorDepthCoplanar = 0.05F;  ///< maximum relative distance of a support on the cell's plane

// Sky (plane.h: far), in errors of the inverse depth that follow from the image:
constexpr float kFarErrors = 2.5F;     ///< maximum inverse depth of a far pixel ...
constexpr float kMaxFarError = 0.4F;   ///< ... with an error of at most this share of the minimum finite inverse depth
constexpr float kFiniteErrors = 4.0F;  ///< minimum inverse depth of a finite pixel
constexpr int kFarMinSupports = 3;  ///< minimum number of far supports for a far cell below kBright; one suffices above
constexpr float kBright = 220.0F;   ///< gray level
constexpr float kWhite = 250.0F;    ///< minimum gray level of bare surfaces that may be overexposed sky
constexpr float kWhiteCost = 0.3F;  ///< kOccluderCost, if whiteness is the only evidence for sky

/// First support in each direction; (0, 0, 0) = none within reach.
struct NearestSupports {
  float x[kPriorDirections], y[kPriorDirections], z[kPriorDirections];
  float errors[kPriorDirections];             ///< of the supports, relative
  float inverse_tolerance[kPriorDirections];  ///< 1 / maximum relative distance of a support on a plane; 0 = no support
  int count;

  PMSP_HD Vec3<float> point(int d) const { return {x[d], y[d], z[d]}; }
  PMSP_HD void put(int d, const Vec3<float>& point, float error, float inverse_tolerance_there) {
    x[d] = point.x;
    y[d] = point.y;
    z[d] = point.z;
    errors[d] = error;
    inverse_tolerance[d] = inverse_tolerance_there;
  }
};

/// Prior plane of a cell; zero = none.
struct PriorPlane {
  Vec3<float> plane;
  int supports;  ///< number on the plane
  float cost;    ///< sum of the distances of all supports [tolerances], each at most 1
};

/// No plane, with the maximum cost.
PMSP_HD PriorPlane no_plane() { return {{0.0F, 0.0F, 0.0F}, 0, static_cast<float>(kPriorDirections)}; }

/// Best support in a share of a cell's pixels.
struct SupportPixel {
  float cost;
  int index;       ///< of the map; -1 = none
  bool uncertain;  ///< whether there are uncertain pixels
  int pixels;      ///< number
  int far;         ///< number of far ones
};

/// All cells, in row order, with input and intermediate results.
template <class ViewTypes>
struct PriorCells {
  typename ViewTypes::Map map;  ///< current planes
  typename ViewTypes::Cube image;
  GridView grid;           ///< of the map
  Baselines baselines;     ///< to the source views
  float spacing;           ///< of samples (tangent of the angle)
  const float* variance;   ///< of the map's pixels, see DepthEvidence
  const float* certainty;  ///< likewise
  float min_variance;      ///< minimum of textured patches
  float far_variance;      ///< minimum as evidence for a far pixel
  PlaneLimits limits;
  int columns, rows;
  const int* great_circles;  ///< cells along great circles from the first cell of a row: [row][direction][step]
  const Vec3<float>* prior_depth_planes;  ///< planes of the cells from prior depth, 0 = none; nullptr = no image
  Vec3<float>* supports;                  ///< points of the surface; (0, 0, 0) = none
  float* errors;                          ///< of the supports, relative
  unsigned char* uncertain;               ///< whether a cell has uncertain pixels
  NearestSupports* around;
  const PriorPlane* previous;  ///< planes of the previous step
  PriorPlane* found;           ///< output
  SupportPixel* pixels;        ///< best of each thread: [cell][thread]
  PriorPlane* candidates;      ///< best plane of each thread: [cell][thread]
  int threads;                 ///< threads per cell
  int stride;                  ///< distance to the cells with planes to adopt [cells]

  PMSP_HD Vec3<float> bearing_at(int x, int y) const { return kernels::bearing_at<float>(grid, x, y); }
};

PMSP_HD bool is_point(const Vec3<float>& p) { return dot(p, p) > 0.0F; }

/// Whether a support is the direction of a far surface.
PMSP_HD bool is_far_point(const Vec3<float>& p) { return dot(p, p) > 1.0F / (kFarLimit * kFarLimit); }
/// Whether it is a point that planes may contain.
PMSP_HD bool is_finite_point(const Vec3<float>& p) { return is_point(p) && !is_far_point(p); }

/// Number of the pixels two steps around pixel (x, y) on its plane.
template <class ViewTypes>
PMSP_HD int neighbours_on_plane(const PriorCells<ViewTypes>& cells, int x, int y, const Vec3<float>& plane) {
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

/// Relative error of a pixel's depth, as far as it follows from the image.
template <class ViewTypes>
PMSP_HD float matching_error(const PriorCells<ViewTypes>& cells, int index, float inverse_depth) {
  return matching_error(cells.variance[index], cells.certainty[index], score_at<float>(cells.map, index), cells.spacing,
                        inverse_depth);
}

/// Whether the image evidence for a pixel's depth is insufficient.
template <class ViewTypes>
PMSP_HD bool is_uncertain(const PriorCells<ViewTypes>& cells, int index, float inverse_depth) {
  return cells.variance[index] < cells.min_variance || matching_error(cells, index, inverse_depth) > kMaxCertainError;
}

/// Error of a pixel's inverse depth, as far as it follows from the image; huge without texture.
template <class ViewTypes>
PMSP_HD float inverse_error(const PriorCells<ViewTypes>& cells, int index) {
  const float score = score_at<float>(cells.map, index);
  if (score * cells.variance[index] < cells.far_variance) return 1e9F;
  return matching_noise(cells.variance[index], score, cells.spacing) / (sqrt(cells.certainty[index]) + 1e-9F);
}

/// Whether the image shows that a pixel is far: its parallax lies within the error, which that of the largest finite
/// depth does not.
template <class ViewTypes>
PMSP_HD bool looks_far(const PriorCells<ViewTypes>& cells, int index, float inverse_depth) {
  const float error = inverse_error(cells, index);
  return error < kMaxFarError * cells.limits.min_inverse_depth &&
         inverse_depth < max(kFarErrors * error, cells.limits.min_inverse_depth + error);
}

/// Point of a pixel's plane with the best image evidence, for instance on an edge beside the pixel.
template <class ViewTypes>
PMSP_HD Vec3<float> best_known(const PriorCells<ViewTypes>& cells, int x, int y) {
  const PatchFrame<float> frame = patch_frame(cells.grid.sin_lon[x], cells.grid.cos_lon[x], cells.grid.sin_lat[y],
                                              cells.grid.cos_lat[y], cells.spacing);
  const Vec3<float> ray = depth_evidence(cells.image, frame, cells.spacing, cells.baselines).best;
  const float inverse = dot(plane_at<float>(cells.map, y * cells.map.width + x), ray);
  return inverse > 0.0F ? (1.0F / inverse) * ray : Vec3<float>{0.0F, 0.0F, 0.0F};
}

/// Writes `pixels` of a cell, for a share of its pixels in row order.
template <class ViewTypes>
PMSP_HD void examine_pixels(const PriorCells<ViewTypes>& cells, int column, int row, int thread) {
  SupportPixel best{2.0F * kSupportMaxError, -1, false, 0, 0};
  const int x0 = column * cells.map.width / cells.columns;
  const int y0 = row * cells.map.height / cells.rows;
  const int columns = (column + 1) * cells.map.width / cells.columns - x0;
  const int count = columns * ((row + 1) * cells.map.height / cells.rows - y0);
  for (int i = thread; i < count; i += cells.threads) {
    const int x = x0 + i % columns;
    const int y = y0 + i / columns;
    const int index = y * cells.map.width + x;
    const Vec3<float> plane = plane_at<float>(cells.map, index);
    const float inverse_depth = dot(plane, cells.bearing_at(x, y));
    if (!(inverse_depth > 0.0F)) continue;
    ++best.pixels;
    if (looks_far(cells, index, inverse_depth)) {
      ++best.far;
      continue;
    }
    best.uncertain = best.uncertain || is_uncertain(cells, index, inverse_depth);
    const float score = score_at<float>(cells.map, index);
    const float error = matching_error(cells, index, inverse_depth);
    if (!(score > kSupportMinScore) || !(error < kSupportMaxError)) continue;
    if (score * cells.variance[index] < kSupportTexture * cells.min_variance) continue;
    const float cost = max(error, kMinSupportError) * (2.0F - score);
    if (!(cost < best.cost) || neighbours_on_plane(cells, x, y, plane) < kSupportMinNeighbours) continue;
    best.cost = cost;
    best.index = index;
  }
  cells.pixels[(row * cells.columns + column) * cells.threads + thread] = best;
}

/// Bearing of a cell's centre.
PMSP_HD Vec3<float> cell_bearing(int column, int row, int columns, int rows) {
  const float pi = static_cast<float>(kPi);
  const float lon = ((static_cast<float>(column) + 0.5F) / static_cast<float>(columns) - 0.5F) * 2.0F * pi;
  const float lat = (0.5F - (static_cast<float>(row) + 0.5F) / static_cast<float>(rows)) * pi;
  return bearing(sinf(lon), cosf(lon), sinf(lat), cosf(lat));
}

/// Writes `supports`, `errors` and `uncertain` of a cell. The best pixel becomes the support; of equal ones the first.
template <class ViewTypes>
PMSP_HD void find_support(const PriorCells<ViewTypes>& cells, int column, int row) {
  const int cell = row * cells.columns + column;
  const SupportPixel* const pixels = cells.pixels + cell * cells.threads;
  SupportPixel best = pixels[0];
  for (int thread = 1; thread < cells.threads; ++thread) {
    const SupportPixel& other = pixels[thread];
    const bool uncertain = best.uncertain || other.uncertain;
    const int all = best.pixels + other.pixels;
    const int far = best.far + other.far;
    const bool is_first = other.cost == best.cost && other.index < best.index;
    if (other.index >= 0 && (other.cost < best.cost || is_first)) best = other;
    best.uncertain = uncertain;
    best.pixels = all;
    best.far = far;
  }
  cells.uncertain[cell] = best.uncertain ? 1 : 0;
  cells.errors[cell] = kSupportMaxError;
  cells.supports[cell] = {0.0F, 0.0F, 0.0F};
  if (best.far > 0 && 2 * best.far >= best.pixels) {
    cells.supports[cell] = (1.0F / kFarInverseDepth) * cell_bearing(column, row, cells.columns, cells.rows);
    return;
  }
  if (best.index < 0) return;
  const int x = best.index % cells.map.width;
  const int y = best.index / cells.map.width;
  const float inverse_depth = dot(plane_at<float>(cells.map, best.index), cells.bearing_at(x, y));
  cells.errors[cell] = matching_error(cells, best.index, inverse_depth);
  cells.supports[cell] = best_known(cells, x, y);
}

/// Number of steps along a great circle, each of the height of a cell.
PMSP_HD int great_circle_steps(int rows) {
  return static_cast<int>(kPriorReach / static_cast<float>(kPi) * static_cast<float>(rows));
}

/// Writes the first support in a direction from a cell with uncertain pixels.
template <class ViewTypes>
PMSP_HD void find_surroundings(const PriorCells<ViewTypes>& cells, int column, int row, int direction) {
  const int cell = row * cells.columns + column;
  if (cells.uncertain[cell] == 0) return;
  NearestSupports& around = cells.around[cell];
  around.put(direction, {0.0F, 0.0F, 0.0F}, 0.0F, 0.0F);
  const int steps = great_circle_steps(cells.rows);
  const int* const great_circle = cells.great_circles + (row * kPriorDirections + direction) * steps;
  for (int i = 0; i < steps; ++i) {
    const bool beyond = great_circle[i] % cells.columns + column >= cells.columns;
    const int there = great_circle[i] + column - (beyond ? cells.columns : 0);
    if (!is_point(cells.supports[there])) continue;
    const float error = cells.errors[there];
    around.put(direction, cells.supports[there], error, 1.0F / min(kPriorTolerance + 2.0F * error, kMaxPriorTolerance));
    return;
  }
}

/// Whether directions, a bit each, leave no gap of more than half a turn. With a wider one, the cell lies outside the
/// supports.
PMSP_HD bool surround(std::uint32_t directions) {
  int gap = 0;
  for (int d = 0; d < 2 * kPriorDirections; ++d) {
    gap = (directions >> (d % kPriorDirections) & 1U) != 0 ? 0 : gap + 1;
    if (gap >= kPriorDirections / 2) return false;
  }
  return true;
}

/// Replaces `best` by a plane that explains the surroundings better. `anywhere`: also if the supports on it do not
/// surround the cell.
PMSP_HD void consider(PriorPlane& best, const Vec3<float>& plane, const NearestSupports& around,
                      const Vec3<float>& bearing, const PlaneLimits& limits, int min_supports = kPriorMinSupports,
                      bool anywhere = false) {
  if (!is_allowed(plane, bearing, limits)) return;
  PriorPlane candidate{plane, 0, 0.0F};
  float offs[kPriorDirections];
  float costs[kPriorDirections];
  PMSP_UNROLL
  for (int d = 0; d < kPriorDirections; ++d) {  // without branches, so that compilers vectorise
    const float behind = (dot(plane, around.point(d)) - 1.0F) * around.inverse_tolerance[d];
    const float off = min(abs(behind), 1.0F);
    offs[d] = around.inverse_tolerance[d] > 0.0F ? off : 1.0F;
    costs[d] = behind < -1.0F ? kOccluderCost : off;
  }
  PMSP_UNROLL
  for (int half = kPriorDirections / 2; half > 0; half /= 2) {
    PMSP_UNROLL
    for (int d = 0; d < half; ++d) costs[d] += costs[d + half];
  }
  candidate.cost = costs[0];
  if (!(candidate.cost < best.cost)) return;
  std::uint32_t on_it = 0;
  PMSP_UNROLL
  for (int d = 0; d < kPriorDirections; ++d) {
    if (!(offs[d] < 1.0F)) continue;
    ++candidate.supports;
    on_it |= 1U << d;
  }
  if (candidate.supports >= min_supports && (anywhere || surround(on_it))) best = candidate;
}

/// Plane through three points; zero if they are coplanar with the camera.
PMSP_HD Vec3<float> plane_through(const Vec3<float>& a, const Vec3<float>& b, const Vec3<float>& c) {
  const Vec3<float> bc = cross(b, c);
  const float volume = dot(a, bc);
  if (volume * volume <= 1e-8F * dot(a, a) * dot(b, b) * dot(c, c)) return {0.0F, 0.0F, 0.0F};
  return (1.0F / volume) * (cross(a, b) + bc + cross(c, a));
}

/// Least-squares plane of the supports that lie on `plane`, weighted by proximity to it and by certainty.
PMSP_HD Vec3<float> refitted(const NearestSupports& around, const Vec3<float>& plane) {
  Vec3<float> rows[3] = {};
  Vec3<float> sum{};
  PMSP_UNROLL
  for (int d = 0; d < kPriorDirections; ++d) {
    const Vec3<float> p = around.point(d);
    if (!is_point(p)) continue;
    const float off = (dot(plane, p) - 1.0F) * around.inverse_tolerance[d];
    if (!(abs(off) < 1.0F)) continue;
    const float error = around.errors[d];
    const float weight = (1.0F - off * off) / (error * error + kCommonSupportError * kCommonSupportError);
    rows[0] = fma(weight * p.x, p, rows[0]);
    rows[1] = fma(weight * p.y, p, rows[1]);
    rows[2] = fma(weight * p.z, p, rows[2]);
    sum = fma(weight, p, sum);
  }
  const Vec3<float> cofactors = cross(rows[1], rows[2]);
  const float determinant = dot(rows[0], cofactors);
  if (!(determinant > 0.0F)) return plane;
  const Vec3<float> scaled =
      fma(sum.x, cofactors, fma(sum.y, cross(rows[2], rows[0]), sum.z * cross(rows[0], rows[1])));
  return (1.0F / determinant) * scaled;
}

PMSP_HD int supports_around(const NearestSupports& around) {
  int count = 0;
  for (int d = 0; d < kPriorDirections; ++d) count += around.inverse_tolerance[d] > 0.0F ? 1 : 0;
  return count;
}

/// Whether planes are fitted for a cell. Every other cell adopts those of its neighbours (choose_plane): half the work,
/// with equal results.
PMSP_HD bool has_candidates(int column, int row) { return ((column + row) & 1) == 0; }

/// Writes `candidates` of a cell with has_candidates: the plane that explains the surroundings best, of a share of the
/// planes through three supports that surround the cell.
template <class ViewTypes>
PMSP_HD void try_planes(const PriorCells<ViewTypes>& cells, int column, int row, int thread) {
  constexpr int kWide = kPriorDirections / 2;  // with a wider gap, the cell would lie outside the triangle
  constexpr int kNarrow = 3;                   // a narrower one makes no good triangle
  constexpr int kGaps = kWide - kNarrow + 1;
  const int cell = row * cells.columns + column;
  PriorPlane best = no_plane();
  const NearestSupports& around = cells.around[cell];
  if (cells.uncertain[cell] != 0 && supports_around(around) >= kPriorMinSupports) {
    const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
    for (int triangle = thread; triangle < kGaps * kGaps * kWide; triangle += cells.threads) {
      const int i = triangle % kWide;  // less than `rest`
      const int j = i + kNarrow + triangle / (kWide * kGaps);
      const int k = j + kNarrow + triangle / kWide % kGaps;
      const int rest = kPriorDirections + i - k;
      if (k >= kPriorDirections || rest < kNarrow || rest > kWide) continue;
      const Vec3<float> a = around.point(i);
      const Vec3<float> b = around.point(j);
      const Vec3<float> c = around.point(k);
      if (!is_finite_point(a) || !is_finite_point(b) || !is_finite_point(c)) continue;
      consider(best, plane_through(a, b, c), around, center, cells.limits);
    }
  }
  cells.candidates[cell * cells.threads + thread] = best;
}

/// Replaces `best` by the best candidate of a cell if that explains the surroundings better, and refits the result.
template <class ViewTypes>
PMSP_HD void take_candidate(const PriorCells<ViewTypes>& cells, int column, int row, PriorPlane& best) {
  const int cell = row * cells.columns + column;
  for (int thread = 0; thread < cells.threads; ++thread) {
    const PriorPlane& other = cells.candidates[cell * cells.threads + thread];
    if (other.cost < best.cost) best = other;
  }
  if (best.supports == 0) return;
  const NearestSupports around = cells.around[cell];  // read at once
  const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
  consider(best, refitted(around, best.plane), around, center, cells.limits);
}

/// Replaces `best` by the far plane if that explains the surroundings better: all finite supports lie in front of it.
/// With too few far supports around, only white cells may be far.
template <class ViewTypes>
PMSP_HD void consider_far(const PriorCells<ViewTypes>& cells, int column, int row, PriorPlane& best) {
  const int cell = row * cells.columns + column;
  if (cells.uncertain[cell] == 0) return;
  int far = 0;
  int finite = 0;
  for (int d = 0; d < kPriorDirections; ++d) {
    const Vec3<float> p = cells.around[cell].point(d);
    far += is_far_point(p) ? 1 : 0;
    finite += is_finite_point(p) ? 1 : 0;
  }
  const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
  const float gray = sample(cells.image, center);
  const bool is_white = gray >= kWhite;
  if (!is_white && far < (gray < kBright ? kFarMinSupports : 1)) return;
  const float cost = (is_white ? kWhiteCost : kOccluderCost) * static_cast<float>(finite);
  if (cost < best.cost) best = {far_plane(center), kPriorDirections, cost};
}

/// Writes `found` of a cell, the best of its candidates, and the number of supports around.
template <class ViewTypes>
PMSP_HD void find_plane(const PriorCells<ViewTypes>& cells, int column, int row) {
  const int cell = row * cells.columns + column;
  NearestSupports& around = cells.around[cell];
  around.count = cells.uncertain[cell] != 0 ? supports_around(around) : 0;
  PriorPlane best = no_plane();
  if (has_candidates(column, row)) take_candidate(cells, column, row, best);
  consider_far(cells, column, row, best);
  cells.found[cell] = best;
}

/// Weight of a support for a cell: higher if nearer.
PMSP_HD float support_weight(const Vec3<float>& p, const Vec3<float>& center) {
  return 1.0F / (max(1.0F - dot(center, p) / sqrt(dot(p, p)), 0.0F) + 0.002F);
}

/// Factor that moves the prior depth plane at a support to the support; 0 = no prior depth plane.
template <class ViewTypes>
PMSP_HD float prior_depth_ratio(const PriorCells<ViewTypes>& cells, const Vec3<float>& p) {
  const float inverse = dot(cells.prior_depth_planes[pixel_index(p, cells.columns, cells.rows)], p);
  return inverse > 0.0F ? 1.0F / inverse : 0.0F;
}

/// Weighted mean of the factors around a cell that differ from `from` by less than `tolerance`, and their share of all.
struct PriorDepthRatio {
  float ratio;
  float share;
  int count;
};
template <class ViewTypes>
PMSP_HD PriorDepthRatio mean_ratio(const PriorCells<ViewTypes>& cells, const NearestSupports& around,
                                   const Vec3<float>& center, float from, float tolerance) {
  PriorDepthRatio mean{0.0F, 0.0F, 0};
  float all = 0.0F;
  for (int d = 0; d < kPriorDirections; ++d) {
    const Vec3<float> p = around.point(d);
    const float ratio = is_finite_point(p) ? prior_depth_ratio(cells, p) : 0.0F;
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

/// Moves a plane through the supports that nearly lie on it, as far as they determine it.
PMSP_HD Vec3<float> through_supports(const Vec3<float>& plane, const NearestSupports& around) {
  Vec3<float> rows[3] = {};
  Vec3<float> sum{};
  float squares = 0.0F;
  for (int d = 0; d < kPriorDirections; ++d) {
    const Vec3<float> p = around.point(d);
    if (!is_finite_point(p)) continue;
    const float off = 1.0F - dot(plane, p);
    if (abs(off) >= kPriorDepthCoplanar) continue;
    rows[0] = fma(p.x, p, rows[0]);
    rows[1] = fma(p.y, p, rows[1]);
    rows[2] = fma(p.z, p, rows[2]);
    sum = fma(off, p, sum);
    squares += dot(p, p);
  }
  const float hold = 0.02F * squares;  // against rotation if supports are collinear
  rows[0].x += hold;
  rows[1].y += hold;
  rows[2].z += hold;
  const Vec3<float> cofactors = cross(rows[1], rows[2]);
  const float determinant = dot(rows[0], cofactors);
  if (!(determinant > 0.0F)) return plane;
  const Vec3<float> move = fma(sum.x, cofactors, fma(sum.y, cross(rows[2], rows[0]), sum.z * cross(rows[0], rows[1])));
  return fma(1.0F / determinant, move, plane);
}

/// Plane of a cell from prior depth, corrected by the factors of the reliable surface around. Zero if these do not
/// agree.
template <class ViewTypes>
PMSP_HD Vec3<float> corrected_prior_depth(const PriorCells<ViewTypes>& cells, int column, int row) {
  const Vec3<float> none{0.0F, 0.0F, 0.0F};
  const int cell = row * cells.columns + column;
  const Vec3<float> prior_depth_plane = cells.prior_depth_planes[cell];
  const NearestSupports& around = cells.around[cell];
  if (!is_point(prior_depth_plane) || around.count < kPriorDepthMinSupports) return none;
  const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
  const PriorDepthRatio all = mean_ratio(cells, around, center, 1.0F, 1e6F);
  if (all.count < kPriorDepthMinSupports) return none;
  const PriorDepthRatio agreed = mean_ratio(cells, around, center, all.ratio, kPriorDepthTolerance);
  if (agreed.count < kPriorDepthMinSupports || agreed.share < kPriorDepthMinShare) return none;
  const Vec3<float> plane = through_supports(agreed.ratio * prior_depth_plane, around);
  return is_allowed(plane, center, cells.limits) ? plane : none;
}

/// Plane of at least four supports, anywhere around the cell, that agrees with the prior depth plane. The prior depth
/// plane selects the supports of the cell's surface, these determine its position. Zero if there is none.
/// `prior_depth_plane`: corrected_prior_depth, not zero.
template <class ViewTypes>
PMSP_HD Vec3<float> agreeing_plane(const PriorCells<ViewTypes>& cells, int column, int row,
                                   const Vec3<float>& prior_depth_plane) {
  const NearestSupports& around = cells.around[row * cells.columns + column];
  const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
  PriorPlane best = no_plane();
  const float there = dot(prior_depth_plane, center);
  const auto agrees = [&](const Vec3<float>& plane) {
    const float along = dot(plane, prior_depth_plane);
    return abs(dot(plane, center) - there) < kAgreeingTolerance * there && along > 0.0F &&
           along * along >
               kAgreeingMinCos * kAgreeingMinCos * dot(plane, plane) * dot(prior_depth_plane, prior_depth_plane);
  };
  for (int i = 0; i < kPriorDirections; ++i) {
    for (int j = i + 1; j < kPriorDirections; ++j) {
      for (int k = j + 1; k < kPriorDirections; ++k) {
        const Vec3<float> a = around.point(i);
        const Vec3<float> b = around.point(j);
        const Vec3<float> c = around.point(k);
        if (!is_finite_point(a) || !is_finite_point(b) || !is_finite_point(c)) continue;
        const Vec3<float> plane = plane_through(a, b, c);
        if (agrees(plane)) consider(best, plane, around, center, cells.limits, kAgreeingMinSupports, true);
      }
    }
  }
  if (best.supports == 0) return best.plane;
  const Vec3<float> plane = refitted(around, best.plane);
  return agrees(plane) && is_allowed(plane, center, cells.limits) ? plane : best.plane;
}

/// Whether a cell may adopt planes of other cells.
template <class ViewTypes>
PMSP_HD bool may_adopt(const PriorCells<ViewTypes>& cells, int cell) {
  return cells.around[cell].count >= kPriorMinSupports;
}

/// Writes `candidates` of a cell: the plane that explains the surroundings best, of a share of the planes of cells
/// `stride` away.
template <class ViewTypes>
PMSP_HD void try_adopted(const PriorCells<ViewTypes>& cells, int column, int row, int thread) {
  const int cell = row * cells.columns + column;
  if (!may_adopt(cells, cell)) return;
  PriorPlane best = no_plane();
  const Vec3<float> center = cell_bearing(column, row, cells.columns, cells.rows);
  for (int i = thread; i < 9; i += cells.threads) {
    const int other_row = row + (i / 3 - 1) * cells.stride;
    const int other_column = (column + (i % 3 - 1) * cells.stride + cells.columns) % cells.columns;
    if (i == 4 || other_row < 0 || other_row >= cells.rows) continue;
    const PriorPlane& other = cells.previous[other_row * cells.columns + other_column];
    if (other.supports == 0 || is_far(dot(other.plane, center))) continue;
    consider(best, other.plane, cells.around[cell], center, cells.limits);
  }
  cells.candidates[cell * cells.threads + thread] = best;
}

/// Writes `found` of a cell: its previous plane, or that of another cell if that explains the surroundings better.
/// Without either after the last step: a plane that agrees with that of the prior depth, or else that of the prior
/// depth.
template <class ViewTypes>
PMSP_HD void choose_plane(const PriorCells<ViewTypes>& cells, int column, int row) {
  const int cell = row * cells.columns + column;
  PriorPlane best = cells.previous[cell];
  if (may_adopt(cells, cell)) take_candidate(cells, column, row, best);
  if (best.supports == 0 && cells.prior_depth_planes != nullptr && cells.stride == 1) {
    const Vec3<float> prior_depth_plane = corrected_prior_depth(cells, column, row);
    best.plane =
        is_point(prior_depth_plane) ? agreeing_plane(cells, column, row, prior_depth_plane) : prior_depth_plane;
    if (!is_point(best.plane)) best.plane = prior_depth_plane;
  }
  cells.found[cell] = best;
}

/// Steps over all cells, one after the other.
enum class PriorStep { kPixels, kSupports, kSurroundings, kCandidates, kPlanes, kAdoption, kChoice };

/// A step; a stage over the cells, over the directions of each cell, or over its shares.
template <class ViewTypes, PriorStep step>
struct PriorCellStep {
  static constexpr int kCounts = 0;
  static constexpr bool kShared =
      step == PriorStep::kPixels || step == PriorStep::kCandidates || step == PriorStep::kAdoption;

  PriorCells<ViewTypes> cells;

  PMSP_HD int width() const {
    if (step == PriorStep::kCandidates) return (cells.columns + 1) / 2 * cells.threads;
    return cells.columns * (step == PriorStep::kSurroundings ? kPriorDirections : kShared ? cells.threads : 1);
  }
  PMSP_HD int height() const { return cells.rows; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    if constexpr (step == PriorStep::kSurroundings) {
      find_surroundings(cells, at.column % cells.columns, at.row, at.column / cells.columns);
    } else if constexpr (kShared) {
      const int cell = at.column / cells.threads;
      const int column = step == PriorStep::kCandidates ? 2 * cell + (at.row & 1) : cell;  // see has_candidates
      if (column >= cells.columns) return;
      const int share = at.column % cells.threads;
      if constexpr (step == PriorStep::kPixels) examine_pixels(cells, column, at.row, share);
      if constexpr (step == PriorStep::kCandidates) try_planes(cells, column, at.row, share);
      if constexpr (step == PriorStep::kAdoption) try_adopted(cells, column, at.row, share);
    } else {
      if constexpr (step == PriorStep::kSupports) find_support(cells, at.column, at.row);
      if constexpr (step == PriorStep::kPlanes) find_plane(cells, at.column, at.row);
      if constexpr (step == PriorStep::kChoice) choose_plane(cells, at.column, at.row);
    }
  }
};

/// Prior plane of a pixel of the map; zero = none. Far planes of cells are not used for pixels with a finite depth
/// according to the image, unless these are white: the patch of an overexposed pixel has the depth of the edge beside
/// it.
template <class ViewTypes>
PMSP_HD Vec3<float> prior_at(const PriorCells<ViewTypes>& cells, int x, int y) {
  const Vec3<float> none{0.0F, 0.0F, 0.0F};
  const int index = y * cells.map.width + x;
  const Vec3<float> bearing = cells.bearing_at(x, y);
  const float inverse_depth = dot(plane_at<float>(cells.map, index), bearing);
  if (!(inverse_depth > 0.0F)) return none;
  if (looks_far(cells, index, inverse_depth)) return far_plane(bearing);
  const int cell = y * cells.rows / cells.map.height * cells.columns + x * cells.columns / cells.map.width;
  const Vec3<float> plane = cells.found[cell].plane;
  if (!is_far(dot(plane, bearing))) return is_uncertain(cells, index, inverse_depth) ? plane : none;
  const bool may_be_far = inverse_depth < kFiniteErrors * inverse_error(cells, index);
  return may_be_far || sample(cells.image, bearing) >= kWhite ? plane : none;
}

/// Image evidence of each pixel's depth; a stage.
template <class ViewTypes>
struct FindEvidence {
  static constexpr int kCounts = 0;

  typename ViewTypes::Cube image;
  GridView grid;
  Baselines baselines;
  float spacing;     ///< of samples (tangent of the angle)
  float* variance;   ///< see DepthEvidence
  float* certainty;  ///< likewise

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* /*counted*/) const {
    const PatchFrame<F> frame = patch_frame(gather<F>(grid.sin_lon, at.column), gather<F>(grid.cos_lon, at.column),
                                            F(grid.sin_lat[at.row]), F(grid.cos_lat[at.row]), F(spacing));
    const DepthEvidence<F> evidence = depth_evidence(image, frame, spacing, baselines);
    store<F>(evidence.variance, variance + at.first, at.count);
    store<F>(evidence.certainty, certainty + at.first, at.count);
  }
};

/// Prior planes of the pixels; a stage.
template <class ViewTypes>
struct PixelPriors {
  static constexpr int kCounts = 0;

  PriorCells<ViewTypes> cells;
  typename ViewTypes::Planes to;  ///< scores are 0

  PMSP_HD int width() const { return cells.map.width; }
  PMSP_HD int height() const { return cells.map.height; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    put(to, static_cast<std::size_t>(at.first), 1, Hypothesis<float>{prior_at(cells, at.column, at.row), 0.0F});
  }
};

}  // namespace pmsp::kernels
