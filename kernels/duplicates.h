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

// Which keyframe's pixel makes the point of a place that several keyframes see. Each function here is pure in what is
// kept of the keyframes (surfel.h): results depend on who is asked, and on no order.
//
// Pixels have a strict total order: finer sampling first, then higher confidence, then the keyframe. A pixel asks only
// for pixels that rank higher, so that no two wait for each other. In each round a pixel reads what the round before
// left: where an owner stands for it, it is dropped; where nobody does who may still become one, it is an owner; else
// it stays open. After the last round what is open is kept, so that every dropped pixel has an owner beside it.
namespace pmsp::kernels {

/// Place in the order of pixels, a whole number; smaller is better, equal ones are for the keyframes to settle. Octaves
/// of the footprint first: what is seen from much closer is sampled more finely. Inside an octave the better estimate
/// wins. `footprint`: size of the pixel on a surface across the ray, in the unit that all keyframes share; > 0.
template <class F>
PMSP_HD F rank(const F& footprint, const F& confidence_level) {
  const F octave = from_uint<F>(UIntOf<F>(bits_of(footprint) >> 23));
  return fma(F(64), octave, F(63) - confidence_level);
}

/// A keyframe's surfels, in row order.
struct SurfelView {
  const std::uint32_t* surfels;
  const std::uint8_t* statuses;
  int width, height;
  float scale;  ///< the keyframe's unit of length in the one that all share
};

PMSP_HD float pixel_angle(const SurfelView& map) { return static_cast<float>(kPi) / static_cast<float>(map.height); }

struct DuplicateLimits {
  float spacing;             ///< points of one surface closer than this are one point [pixels of the dropped one]
  float max_relative_depth;  ///< largest deviation from one surface, however large the expected errors
  float min_cos_normals;     ///< of the normals of one surface
};

/// A keyframe that is asked.
struct DuplicateView {
  SurfelView map;
  Rigid other_from_first;  ///< from the first keyframe's unit of length into the other's: the rotation times `zoom`
  float zoom;              ///< the first keyframe's scale over the other's
  bool before;             ///< of pixels of equal rank the other keyframe's comes first
};

/// Sum of the two points' expected errors (medians) up to which they may lie on one surface.
constexpr float kSameSurfaceErrors = 4.0F;

/// How far along the normal a point may lie off its surface, and how far off it may lie at most to count as on it.
template <class F>
struct OffSurface {
  F error, most;
};
template <class F>
PMSP_HD OffSurface<F> off_surface(const F& depth, const Vec3<F>& normal, const Vec3<F>& bearing, const F& confidence,
                                  float max_relative_depth) {
  const F across = depth * abs(dot(normal, bearing));
  const F error = error_of_confidence(confidence);
  return {across * sqrt(fma(error, error, F(kCommonError * kCommonError))), across * F(max_relative_depth)};
}

/// A pixel that asks, in its keyframe's frame and unit.
template <class F>
struct Claim {
  Vec3<F> point, normal;
  OffSurface<F> off;
  F reach;  ///< how near an owner stands for it
  F rank;
};

/// `bearing` of a pixel that has a surfel.
template <class F>
PMSP_HD Claim<F> claim_of(const UIntOf<F>& surfel, const UIntOf<F>& status, const Vec3<F>& bearing,
                          const SurfelView& map, const DuplicateLimits& limits) {
  const F depth = depth_of_surfel<F>(surfel);
  const Vec3<F> normal = normal_of_surfel<F>(surfel);
  const UIntOf<F> level = status >> 2;
  const F footprint = depth * F(pixel_angle(map));
  return {depth * bearing, normal,
          off_surface(depth, normal, bearing, confidence_of_level<F>(level), limits.max_relative_depth),
          F(limits.spacing) * footprint, rank(F(map.scale) * footprint, from_uint<F>(level))};
}

/// Whether pixels of another map at a claim's point `p`, in the other's frame, may rank higher.
template <class F>
PMSP_HD MaskOf<F> may_rank_higher(const Vec3<F>& p, const F& own_rank, const DuplicateView& other) {
  constexpr float kNearer = 0.9F;  // what may own the place is hardly nearer than the point
  return rank(F(kNearer * other.map.scale * pixel_angle(other.map)) * sqrt(dot(p, p)), F(63)) <= own_rank;
}

/// Where another keyframe sees a claim's point.
template <class F>
struct Approach {
  Pixel<F> at;
  F spacing;  ///< what may own the place lies within so many pixels
};

/// However finely another keyframe sees the place, no more of its pixels are looked at than within this many.
constexpr float kMaxReach = 4.0F;

template <class F>
PMSP_HD Approach<F> approach(const Vec3<F>& p, const F& reach, const DuplicateView& other) {
  const F range = sqrt(max(dot(p, p), F(1e-30F)));
  return {project(p, F(static_cast<float>(other.map.width)), F(static_cast<float>(other.map.height))),
          min(F(other.zoom / pixel_angle(other.map)) * reach / range, F(kMaxReach))};
}

/// Which pixels of another map lie within reach of a claim's point: for most points one at most, the one that they fall
/// into.
template <class F>
struct Within {
  IntOf<F> column, row;  ///< of the pixel that the point falls into
  MaskOf<F> this_one;    ///< it is the only one
  MaskOf<F> several;     ///< others may be: find_within finds them
};
template <class F>
PMSP_HD Within<F> within(const Approach<F>& there, const GridView& grid, int width, int height) {
  const IntOf<F> x = column(there.at.x, width);
  const IntOf<F> y = row(there.at.y, height);
  const F dx = from_int<F>(x) + F(0.5F) - there.at.x;
  const F dy = from_int<F>(y) + F(0.5F) - there.at.y;
  const F square = fma(there.spacing, there.spacing, F(0) - dy * dy);
  const F reach = sqrt(max(square, F(0))) / gather<F>(grid.cos_lat, y);
  const MaskOf<F> one = (there.spacing < F(0.5F)) & (reach < F(0.5F));
  const MaskOf<F> more = (there.spacing >= F(0.5F)) | (reach >= F(0.5F));
  const MaskOf<F> this_one = one & (square >= F(0)) & (abs(dx) <= reach);
  return {x, y, this_one, more};
}

/// Whether a pixel of another map, which makes a point or may make one, stands for a claim. `p`: the claim's point in
/// the other frame.
template <class F>
PMSP_HD MaskOf<F> stands_for(const UIntOf<F>& surfel, const UIntOf<F>& status, const Vec3<F>& bearing, const Vec3<F>& p,
                             const Vec3<F>& claim_normal, const OffSurface<F>& claim_off, const F& claim_rank,
                             const DuplicateView& other, const DuplicateLimits& limits) {
  const F depth = depth_of_surfel<F>(surfel);
  const UIntOf<F> level = status >> 2;
  const F own_rank = rank(F(other.map.scale * pixel_angle(other.map)) * depth, from_uint<F>(level));
  const Vec3<F> there = normal_of_surfel<F>(surfel);
  const Vec3<F> normal = F(1.0F / other.zoom) * rotate(other.other_from_first, claim_normal);
  const Vec3<F> apart = depth * bearing - p;
  const OffSurface<F> off =
      off_surface(depth, there, bearing, confidence_of_level<F>(level), limits.max_relative_depth);
  const F tolerance = min(F(kSameSurfaceErrors) * fma(F(other.zoom), claim_off.error, off.error),
                          max(F(other.zoom) * claim_off.most, off.most));
  // Ranks are whole numbers.
  return (own_rank < claim_rank + F(other.before ? 0.5F : -0.5F)) & (dot(there, normal) >= F(limits.min_cos_normals)) &
         (min(abs(dot(apart, there)), abs(dot(apart, normal))) <= tolerance);
}

/// A round for the open pixels of a keyframe. Of those that are asked, only those matter in later rounds that have a
/// pixel which would stand for this one if it were an owner. Rows of the CPU (src/cpu/duplicate_row.h) and warps of a
/// GPU (src/cuda/own.cu) share the work in ways of their own.
struct DuplicateRound {
  SurfelView map;  ///< what the round before left, as `others` are
  GridView grid;   ///< of all maps
  DuplicateView others[kMaxViewers];
  int count;
  DuplicateLimits limits;
  std::uint8_t* statuses;  ///< after the round; not those of `map`

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }
};

/// Whether a pixel's point is eligible; a stage. Viewers speak for and against it, the keyframe itself for it, each
/// with its weight (weight_of_word). The confidence becomes that of the map times the share that speaks for it. What a
/// mirror shows is not eligible. Counts what is eligible.
struct Eligibility {
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
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* counted) const {
    const F depth = depth_of_surfel<F>(gather_words<F>(surfels, at.index));
    const MaskOf<F> known = depth > F(0);
    counted[0] = known;
    if (!any(known)) return store_bytes<F>(UIntOf<F>(0U), statuses + at.first, 1, at.count);
    const Vec3<F> point = select(known, depth, F(1)) * bearing_at(grid, at);
    const F own = dot(point, point);
    F on_surface(1);  // the keyframe's own word
    F through(0);
    for (int k = 0; k < count; ++k) {
      const Viewer& viewer = viewers[k];
      const RangeVote<F> seen = range_vote(point, viewer.ranges, viewer.other_from_first, limits);
      const F weight = weight_of_word(F(F(viewer.zoom * viewer.zoom) * own), seen.square);
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
