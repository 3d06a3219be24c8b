// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "stage.h"

// Initial planes: those of landmarks, and those of the previous keyframe, warped. If several compete for a pixel the
// smallest key wins: distance first, then index, independent of the order of threads.
// `atomic_min_key` keeps the smaller one.
namespace pmsp::kernels {

constexpr std::uint64_t kNoKey = ~std::uint64_t{0};

PMSP_HD std::uint64_t init_key(float distance, std::uint32_t index) {
  return static_cast<std::uint64_t>(bits_of(distance)) << 32U | index;
}

/// Observed landmark: image point [px], and the plane through it that faces the camera.
struct SparsePoint {
  float x, y;
  Vec3<float> plane;
};

/// Splats landmarks over the pixels within `radius_px`.
template <class Keys>
struct SplatLandmarks {
  const SparsePoint* points;
  GridView grid;
  float radius_px;
  Keys keys;  ///< per pixel, initially kNoKey

  /// Landmark i: every `threads`-th column from the `thread`-th.
  PMSP_HD void operator()(int i, int thread, int threads) const {
    const SparsePoint point = points[i];
    const int y0 = static_cast<int>(max(0.0F, ::floorf(point.y - radius_px)));
    const int y1 = static_cast<int>(min(static_cast<float>(grid.height - 1), ::floorf(point.y + radius_px)));
    for (int y = y0; y <= y1; ++y) {
      const float dy = static_cast<float>(y) + 0.5F - point.y;
      const float narrowing = max(grid.cos_lat[y], 1e-3F);
      const float reach = min(radius_px / narrowing, 0.5F * static_cast<float>(grid.width) - 1.0F);
      const int last = static_cast<int>(::floorf(point.x + reach));
      for (int column = static_cast<int>(::floorf(point.x - reach)) + thread; column <= last; column += threads) {
        const float dx = (static_cast<float>(column) + 0.5F - point.x) * narrowing;
        const float distance = dx * dx + dy * dy;
        if (distance > radius_px * radius_px) continue;
        atomic_min_key(keys, y * grid.width + (column + grid.width) % grid.width,
                       init_key(distance, static_cast<std::uint32_t>(i)));
      }
    }
  }
};

/// Warps the pixels of a map into another keyframe; a stage over the map.
template <class ViewTypes, class Keys>
struct WarpPixels {
  static constexpr int kCounts = 0;

  typename ViewTypes::Map map;
  GridView grid;  ///< of the map
  Rigid other_from_map;
  int other_width, other_height;
  Keys keys;  ///< per pixel of the other keyframe, initially kNoKey

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const Vec3<float> bearing = bearing_at(grid, at);
    const Surface<float> surface = surface_of(plane_at<float>(map, at.index), bearing);
    if (!surface.known) return;
    const Vec3<float> p = transform(other_from_map, surface.depth * bearing);
    atomic_min_key(keys, pixel_index(p, other_width, other_height),
                   init_key(sqrt(dot(p, p)), static_cast<std::uint32_t>(at.index)));
  }
};

/// Planes selected by keys, readable as a map.
struct LandmarkPlanes {
  const std::uint64_t* keys;  ///< nullptr = none
  const SparsePoint* points;
};
PMSP_HD bool is_empty(const LandmarkPlanes& planes) { return planes.keys == nullptr; }
template <class F>
PMSP_HD Vec3<F> plane_at(const LandmarkPlanes& planes, int pixel) {
  const std::uint64_t key = planes.keys[pixel];
  return key == kNoKey ? Vec3<F>{0.0F, 0.0F, 0.0F} : planes.points[static_cast<std::uint32_t>(key)].plane;
}

template <class Map>
struct WarpedPlanes {
  const std::uint64_t* keys;  ///< nullptr = none
  Map map;
  Rigid map_from_other;
};
template <class Map>
PMSP_HD bool is_empty(const WarpedPlanes<Map>& planes) {
  return planes.keys == nullptr;
}
template <class F, class Map>
PMSP_HD Vec3<F> plane_at(const WarpedPlanes<Map>& planes, int pixel) {
  const std::uint64_t key = planes.keys[pixel];
  if (key == kNoKey) return {0.0F, 0.0F, 0.0F};
  return moved_plane(plane_at<F>(planes.map, static_cast<int>(static_cast<std::uint32_t>(key))), planes.map_from_other);
}

/// Writes the planes selected by keys to a map; a stage. Scores are 0.
template <class ViewTypes, class Source>
struct PlanesOfKeys {
  static constexpr int kCounts = 0;

  Source source;  ///< LandmarkPlanes or WarpedPlanes
  GridView grid;
  typename ViewTypes::Planes to;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    put(to, static_cast<std::size_t>(at.first), 1, Hypothesis<float>{plane_at<float>(source, at.index), 0.0F});
  }
};

}  // namespace pmsp::kernels
