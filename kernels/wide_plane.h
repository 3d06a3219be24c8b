// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "grid_view.h"
#include "stage.h"
#include "surfel.h"

// Wide planes of a keyframe: floor, ceiling, walls. A plane is fitted to the points of each tile of the sphere; those
// with the largest share of the sphere are kept.
namespace pmsp::kernels {

constexpr int kTileColumns = 16;  ///< number of tiles in a row
constexpr int kTileRows = 8;
constexpr int kTiles = kTileColumns * kTileRows;
constexpr int kTileSide = 20;               ///< points along each side of a tile, for the fit
constexpr float kMinTileShare = 0.3F;       ///< minimum share of them with a depth, and on the plane
constexpr float kOnPlane = 0.01F;           ///< maximum relative deviation of points on a plane
constexpr int kSphereRows = 32;             ///< rows of the lattice that measures a plane's share of the sphere
constexpr float kLeastOfSphere = 0.02F;     ///< minimum share
constexpr float kSamePlaneCos = 0.97F;      ///< minimum cosine between normals of equal planes ...
constexpr float kSamePlaneDistance = 0.1F;  ///< ... and maximum relative difference of their distances
constexpr int kWidePlanes = 4;              ///< maximum number per keyframe

/// Plane v: v . X = 1 for its points X, in the keyframe's frame; 0 = none.
struct WidePlane {
  Vec3<float> plane;
  float support;  ///< share of the sphere on it
};

/// Point of a keyframe at a pixel; 0 = none.
PMSP_HD Vec3<float> surfel_point(const std::uint32_t* surfels, const GridView& grid, int column, int row) {
  return depth_of_surfel<float>(surfels[row * grid.width + column]) * bearing_at<float>(grid, column, row);
}

PMSP_HD float off_plane(const Vec3<float>& plane, const Vec3<float>& point) { return abs(dot(plane, point) - 1.0F); }

constexpr float kMinTilePoints = kMinTileShare * kTileSide * kTileSide;

/// Sums over points of a tile of the sphere. A tile's work is divided among kTileSide threads, one per column of its
/// lattice.
struct TileSums {
  float xx, xy, xz, yy, yz, zz;  ///< of products of coordinates [`unit` squared]
  Vec3<float> sum;               ///< of points [`unit`]
  float count, unit;
};

/// Share of a tile's work.
struct TileThread {
  int column, row;  ///< of the tile
  int number;
};

/// Tile and thread of a stage over all threads of all tiles.
PMSP_HD TileThread tile_thread(const RowPixels<float>& at) {
  return {at.column / kTileSide, at.row, at.column % kTileSide};
}

/// Point i (below kTileSide) of a thread.
PMSP_HD Vec3<float> tile_point(const std::uint32_t* surfels, const GridView& grid, const TileThread& thread, int i) {
  const int column = (thread.column * kTileSide + thread.number) * grid.width / (kTileColumns * kTileSide);
  const int row = (thread.row * kTileSide + i) * grid.height / (kTileRows * kTileSide);
  return surfel_point(surfels, grid, column, row);
}

/// Least-squares plane of a tile from the sums of its threads; zero if there are too few points.
PMSP_HD Vec3<float> plane_of_sums(const TileSums* threads) {
  const Vec3<float> none{0.0F, 0.0F, 0.0F};
  TileSums all{};
  for (int i = 0; i < kTileSide; ++i) {
    const TileSums& one = threads[i];
    if (one.count == 0.0F) continue;
    if (all.count == 0.0F) all.unit = one.unit;
    const float scale = one.unit / all.unit;
    const float square = scale * scale;
    all.xx = fma(square, one.xx, all.xx);
    all.xy = fma(square, one.xy, all.xy);
    all.xz = fma(square, one.xz, all.xz);
    all.yy = fma(square, one.yy, all.yy);
    all.yz = fma(square, one.yz, all.yz);
    all.zz = fma(square, one.zz, all.zz);
    all.sum = fma(scale, one.sum, all.sum);
    all.count += one.count;
  }
  if (all.count < kMinTilePoints) return none;
  const Vec3<float> x{all.xx, all.xy, all.xz};
  const Vec3<float> y{all.xy, all.yy, all.yz};
  const Vec3<float> z{all.xz, all.yz, all.zz};
  const Vec3<float> yz = cross(y, z);
  const float determinant = dot(x, yz) * all.unit;
  if (!(determinant > 0.0F)) return none;
  return (1.0F / determinant) * (all.sum.x * yz + all.sum.y * cross(z, x) + all.sum.z * cross(x, y));
}

/// Maximum deviation from the plane of the previous fit for points of a fit; the first fit uses all.
constexpr float kTileReach[] = {1e30F, 0.2F, 0.05F, 0.02F};

/// Fit of the planes of all tiles; a stage over the threads.
struct FitTiles {
  static constexpr int kCounts = 0;

  const std::uint32_t* surfels;
  GridView grid;
  const TileSums* previous;  ///< of the previous fit; nullptr = none
  float reach;
  TileSums* sums;

  PMSP_HD int width() const { return kTileColumns * kTileSide; }
  PMSP_HD int height() const { return kTileRows; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const TileThread thread = tile_thread(at);
    Vec3<float> plane{0.0F, 0.0F, 0.0F};
    if (previous != nullptr) plane = plane_of_sums(previous + (at.index - thread.number));
    TileSums own{};
    for (int i = 0; i < kTileSide; ++i) {
      Vec3<float> point = tile_point(surfels, grid, thread, i);
      const float square = dot(point, point);
      if (!(square > 0.0F) || !(off_plane(plane, point) < reach)) continue;
      if (own.count == 0.0F) own.unit = sqrt(square);
      point = (1.0F / own.unit) * point;
      own.xx = fma(point.x, point.x, own.xx);
      own.xy = fma(point.x, point.y, own.xy);
      own.xz = fma(point.x, point.z, own.xz);
      own.yy = fma(point.y, point.y, own.yy);
      own.yz = fma(point.y, point.z, own.yz);
      own.zz = fma(point.z, point.z, own.zz);
      own.sum = own.sum + point;
      own.count += 1.0F;
    }
    sums[at.index] = own;
  }
};

/// Support of a tile's plane, from one of its threads.
struct TileSupport {
  float points;  ///< points of the share on the plane
  float sphere;  ///< weight of the points on the plane, in a part of the lattice on the sphere
};

/// Measures the support of planes; a stage over the threads.
struct MeasureTiles {
  static constexpr int kCounts = 0;

  const std::uint32_t* surfels;
  GridView grid;
  const TileSums* sums;  ///< of the last fit
  TileSupport* supports;

  PMSP_HD int width() const { return kTileColumns * kTileSide; }
  PMSP_HD int height() const { return kTileRows; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const TileThread thread = tile_thread(at);
    const Vec3<float> plane = plane_of_sums(sums + (at.index - thread.number));
    TileSupport own{0.0F, 0.0F};
    const bool is_there = dot(plane, plane) > 0.0F;
    for (int i = 0; i < kTileSide && is_there; ++i) {
      const Vec3<float> point = tile_point(surfels, grid, thread, i);
      own.points += off_plane(plane, point) < kOnPlane ? 1.0F : 0.0F;
    }
    for (int i = thread.number; i < 2 * kSphereRows * kSphereRows && is_there; i += kTileSide) {
      const int row = (2 * (i / (2 * kSphereRows)) + 1) * grid.height / (2 * kSphereRows);
      const int column = (2 * (i % (2 * kSphereRows)) + 1) * grid.width / (4 * kSphereRows);
      const Vec3<float> point = surfel_point(surfels, grid, column, row);
      own.sphere += off_plane(plane, point) < kOnPlane ? grid.cos_lat[row] : 0.0F;
    }
    supports[at.index] = own;
  }
};

/// Plane of each tile; a stage over the tiles.
struct FindWidePlanes {
  static constexpr int kCounts = 0;

  GridView grid;
  const TileSums* sums;
  const TileSupport* supports;
  WidePlane* found;

  PMSP_HD int width() const { return kTileColumns; }
  PMSP_HD int height() const { return kTileRows; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const int first = at.index * kTileSide;
    TileSupport all{0.0F, 0.0F};
    for (int i = first; i < first + kTileSide; ++i) {
      all.points += supports[i].points;
      all.sphere += supports[i].sphere;
    }
    float sphere = 0.0F;
    for (int i = 0; i < kSphereRows; ++i) sphere += grid.cos_lat[(2 * i + 1) * grid.height / (2 * kSphereRows)];
    found[at.index] = all.points < kMinTilePoints
                          ? WidePlane{{0.0F, 0.0F, 0.0F}, 0.0F}
                          : WidePlane{plane_of_sums(sums + first), all.sphere / (2.0F * kSphereRows * sphere)};
  }
};

PMSP_HD bool is_same_plane(const Vec3<float>& a, const Vec3<float>& b) {
  const float length_a = sqrt(dot(a, a));
  const float length_b = sqrt(dot(b, b));
  return dot(a, b) > kSamePlaneCos * length_a * length_b &&
         abs(length_a - length_b) < kSamePlaneDistance * max(length_a, length_b);
}

/// Distinct planes with the largest support; a stage of one pixel.
struct ChooseWidePlanes {
  static constexpr int kCounts = 0;

  const WidePlane* found;
  WidePlane* chosen;  ///< kWidePlanes

  PMSP_HD int width() const { return 1; }
  PMSP_HD int height() const { return 1; }

  PMSP_HD void operator()(const RowPixels<float>& /*at*/, bool* /*counted*/) const {
    WidePlane best[kWidePlanes];
    PMSP_UNROLL
    for (int m = 0; m < kWidePlanes; ++m) {
      best[m] = {{0.0F, 0.0F, 0.0F}, kLeastOfSphere};
      for (int i = 0; i < kTiles; ++i) {
        const WidePlane tile = found[i];
        bool is_new = tile.support > best[m].support;
        for (int other = 0; other < m && is_new; ++other) is_new = !is_same_plane(tile.plane, best[other].plane);
        if (is_new) best[m] = tile;
      }
    }
    for (int m = 0; m < kWidePlanes; ++m) chosen[m] = best[m];
  }
};

PMSP_HD bool is_plane(const WidePlane& plane) { return dot(plane.plane, plane.plane) > 0.0F; }

template <class F>
PMSP_HD Vec3<F> plane_of(const WidePlane& plane) {
  return {F(plane.plane.x), F(plane.plane.y), F(plane.plane.z)};
}

}  // namespace pmsp::kernels
