// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "agreement.h"
#include "confidence.h"
#include "fusion_weight.h"
#include "mirror.h"
#include "ranges.h"
#include "stage.h"
#include "surfel.h"

// Duplicate removal: selection of one of several points of the same surface patch. All functions are pure in the stored
// surfels (surfel.h): results depend on the other views, not on any order.
//
// Pixels have a strict total order: finer sampling first, then higher confidence, then the keyframe. Duplicates of a
// pixel rank better, so that no two pixels wait for each other. Each round reads the status of the previous one: a
// pixel is dropped if a duplicate is kept, kept if none is kept or open, else stays open. Pixels that are open after
// the last round are kept, so that every dropped pixel has a kept duplicate.
namespace pmsp::kernels {

/// Rank of a pixel, a whole number; smaller is better, ties are decided by the keyframes. Octaves of the footprint
/// first, since close views sample more finely; within an octave the confidence. `footprint`: size of the pixel on a
/// surface across the ray, in the common unit; > 0.
template <class F>
PMSP_HD F rank(const F& footprint, const F& confidence_level) {
  const F octave = from_uint<F>(UIntOf<F>(bits_of(footprint) >> 23));
  return fma(F(64), octave, F(63) - confidence_level);
}

/// Surfels of a keyframe, in row order.
struct SurfelView {
  const std::uint32_t* surfels;
  const std::uint8_t* statuses;
  int width, height;
  float scale;  ///< keyframe's unit in the common unit
};

PMSP_HD float pixel_angle(const SurfelView& map) { return static_cast<float>(kPi) / static_cast<float>(map.height); }

struct DuplicateLimits {
  float spacing;             ///< maximum distance of duplicates [pixels of the dropped one]
  float max_relative_depth;  ///< maximum relative deviation from the same surface, for any expected error
  float min_cos_normals;     ///< minimum cosine between normals of the same surface
};

/// Keyframe that may contain duplicates.
struct DuplicateView {
  SurfelView map;
  Rigid other_from_first;  ///< from the first keyframe's unit into the other's: the rotation times `scale_ratio`
  float scale_ratio;       ///< first keyframe's scale / the other's
  bool precedes;           ///< at equal ranks, pixels of the other keyframe come first
};

/// Maximum distance of points of the same surface, over the sum of their expected (median) errors.
constexpr float kSameSurfaceErrors = 4.0F;

/// Distance of a point from its surface along the normal: expected, and maximum to count as on it.
template <class F>
struct SurfaceDistance {
  F error, max;
};
template <class F>
PMSP_HD SurfaceDistance<F> off_surface(const F& depth, const Vec3<F>& normal, const Vec3<F>& bearing,
                                       const F& confidence, float max_relative_depth) {
  const F across = depth * abs(dot(normal, bearing));
  const F error = error_of_confidence(confidence);
  return {across * sqrt(fma(error, error, F(kCommonError * kCommonError))), across * F(max_relative_depth)};
}

/// Open pixel in duplicate removal, in its keyframe's frame and unit.
template <class F>
struct OpenPoint {
  Vec3<F> point, normal;
  SurfaceDistance<F> off;
  F reach;  ///< maximum distance of duplicates
  F rank;
};

/// `bearing`: of a pixel with a surfel.
template <class F>
PMSP_HD OpenPoint<F> open_point_of(const UIntOf<F>& surfel, const UIntOf<F>& status, const Vec3<F>& bearing,
                                   const SurfelView& map, const DuplicateLimits& limits) {
  const F depth = depth_of_surfel<F>(surfel);
  const Vec3<F> normal = normal_of_surfel<F>(surfel);
  const UIntOf<F> level = status >> 2;
  const F footprint = depth * F(pixel_angle(map));
  return {depth * bearing, normal,
          off_surface(depth, normal, bearing, confidence_of_level<F>(level), limits.max_relative_depth),
          F(limits.spacing) * footprint, rank(F(map.scale) * footprint, from_uint<F>(level))};
}

/// Whether pixels of another map at an open point may rank higher. `p`: the point in the other's frame.
template <class F>
PMSP_HD MaskOf<F> may_rank_higher(const Vec3<F>& p, const F& open_rank, const DuplicateView& other) {
  constexpr float kNearer = 0.9F;  // duplicates are hardly nearer than the point
  return rank(F(kNearer * other.map.scale * pixel_angle(other.map)) * sqrt(dot(p, p)), F(63)) <= open_rank;
}

/// Projection of an open point into another keyframe.
template <class F>
struct SearchRegion {
  Pixel<F> at;
  F spacing;  ///< search radius for duplicates [px]
};

/// Maximum search radius [px], however finely the other keyframe samples the surface.
constexpr float kMaxReach = 4.0F;

template <class F>
PMSP_HD SearchRegion<F> search_region(const Vec3<F>& p, const F& reach, const DuplicateView& other) {
  const F range = sqrt(max(dot(p, p), F(1e-30F)));
  return {project(p, F(static_cast<float>(other.map.width)), F(static_cast<float>(other.map.height))),
          min(F(other.scale_ratio / pixel_angle(other.map)) * reach / range, F(kMaxReach))};
}

/// Pixels of another map within the search radius of an open point: for most points at most one, the pixel that
/// contains it.
template <class F>
struct PixelsInRadius {
  IntOf<F> column, row;  ///< of the pixel that contains the point
  MaskOf<F> single;      ///< this pixel is the only one
  MaskOf<F> multiple;    ///< others are possible; see find_within
};
template <class F>
PMSP_HD PixelsInRadius<F> pixels_in_radius(const SearchRegion<F>& there, const GridView& grid, int width, int height) {
  const IntOf<F> x = column(there.at.x, width);
  const IntOf<F> y = row(there.at.y, height);
  const F dx = from_int<F>(x) + F(0.5F) - there.at.x;
  const F dy = from_int<F>(y) + F(0.5F) - there.at.y;
  const F square = fma(there.spacing, there.spacing, F(0) - dy * dy);
  const F reach = sqrt(max(square, F(0))) / gather<F>(grid.cos_lat, y);
  const MaskOf<F> one = (there.spacing < F(0.5F)) & (reach < F(0.5F));
  const MaskOf<F> more = (there.spacing >= F(0.5F)) | (reach >= F(0.5F));
  const MaskOf<F> single = one & (square >= F(0)) & (abs(dx) <= reach);
  return {x, y, single, more};
}

/// Whether a kept or open pixel of another map is a duplicate of an open point. `p`: the point in the other's frame.
template <class F>
PMSP_HD MaskOf<F> is_duplicate(const UIntOf<F>& surfel, const UIntOf<F>& status, const Vec3<F>& bearing,
                               const Vec3<F>& p, const Vec3<F>& open_normal, const SurfaceDistance<F>& open_off,
                               const F& open_rank, const DuplicateView& other, const DuplicateLimits& limits) {
  const F depth = depth_of_surfel<F>(surfel);
  const UIntOf<F> level = status >> 2;
  const F other_rank = rank(F(other.map.scale * pixel_angle(other.map)) * depth, from_uint<F>(level));
  const Vec3<F> there = normal_of_surfel<F>(surfel);
  const Vec3<F> normal = F(1.0F / other.scale_ratio) * rotate(other.other_from_first, open_normal);
  const Vec3<F> apart = depth * bearing - p;
  const SurfaceDistance<F> off =
      off_surface(depth, there, bearing, confidence_of_level<F>(level), limits.max_relative_depth);
  const F tolerance = min(F(kSameSurfaceErrors) * fma(F(other.scale_ratio), open_off.error, off.error),
                          max(F(other.scale_ratio) * open_off.max, off.max));
  // Ranks are whole numbers.
  return (other_rank < open_rank + F(other.precedes ? 0.5F : -0.5F)) &
         (dot(there, normal) >= F(limits.min_cos_normals)) &
         (min(abs(dot(apart, there)), abs(dot(apart, normal))) <= tolerance);
}

/// Round of duplicate removal for the open pixels of a keyframe. A view stays a candidate of a pixel while it has a
/// kept or open duplicate of it. Rows of the CPU (src/cpu/duplicate_row.h) and warps of a GPU (src/cuda/duplicates.cu)
/// divide the work differently.
struct DuplicateRound {
  SurfelView map;  ///< status after the previous round, as in `others`
  GridView grid;   ///< of all maps
  DuplicateView others[kMaxViewers];
  int count;
  DuplicateLimits limits;
  std::uint8_t* statuses;  ///< after the round; not those of `map`

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }
};

/// Free-space test of a pixel's point; a stage. Viewers confirm or contradict it, the keyframe itself confirms, each
/// with its weight (evidence_weight). The confidence becomes that of the map times the confirming share. Mirror images
/// are removed. Counts remaining points.
struct FreeSpaceTest {
  static constexpr int kCounts = 1;

  const std::uint32_t* surfels;
  const std::uint32_t* details;
  GridView grid;
  Viewer viewers[kMaxViewers];
  int count;
  FreeSpaceLimits limits;
  float max_contradiction;
  MirrorView mirrors;
  std::uint8_t* statuses;  ///< kOpen or 0

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* counted) const {
    const F depth = depth_of_surfel<F>(gather_words<F>(surfels, at.index));
    const MaskOf<F> known = depth > F(0);
    counted[0] = known;
    if (!any(known)) return store_bytes<F>(UIntOf<F>(0U), statuses + at.first, 1, at.count);
    const Vec3<F> point = select(known, depth, F(1)) * bearing_at(grid, at);
    const F own = dot(point, point);
    F on_surface(1);  // the keyframe itself confirms
    F through(0);
    for (int k = 0; k < count; ++k) {
      const Viewer& viewer = viewers[k];
      const RangeVote<F> seen = range_vote(point, viewer.ranges, viewer.other_from_first, limits);
      const F weight = evidence_weight(F(F(viewer.scale_ratio * viewer.scale_ratio) * own), seen.square);
      on_surface = on_surface + select(seen.on_surface, weight, F(0));
      through = through + select(seen.through, weight, F(0));
    }
    MaskOf<F> stays = known & (through <= F(max_contradiction) * on_surface);
    if (mirrors.mirrors != nullptr) stays = stays & !is_mirrored(mirrors, grid, at, point);
    const F confidence = own_confidence<F>(gather_words<F>(details, at.index)) * on_surface / (on_surface + through);
    counted[0] = stays;
    store_bytes<F>(select_bits<F>(stays, pack_status(confidence, PointStatus::kOpen)), statuses + at.first, 1,
                   at.count);
  }
};

}  // namespace pmsp::kernels
