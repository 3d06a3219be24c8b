// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "confidence.h"
#include "fusion.h"
#include "grid_view.h"
#include "sight.h"

// Which keyframe's pixel makes the point of a place that several keyframes see. What is kept of a keyframe for that are
// its surfels: 32 bits a pixel for depth and normal, and 8 bits for confidence and standing. Each function here is pure
// in them: results depend on who is asked, and on no order.
//
// Pixels have a strict total order: finer sampling first, then higher confidence, then the keyframe. A pixel asks only
// for pixels that rank higher, so that no two wait for each other. In each round a pixel reads what the round before
// left: where an owner stands for it, it is dropped; where nobody does who may still become one, it is an owner; else
// it stays open. After the last round what is open is kept, so that every dropped pixel has an owner beside it.
namespace pmsp::kernels {

/// Of a pixel's point.
enum class Standing : std::uint8_t {
  kNone = 0,     ///< no depth, too little confidence, or looked through: makes no point, stands for none
  kOpen = 1,     ///< eligible, not yet decided
  kOwner = 2,    ///< makes the point of its place
  kDropped = 3,  ///< an owner stands for it
};

PMSP_HD std::uint32_t bits_of(float value) {
  std::uint32_t bits = 0;
  ::memcpy(&bits, &value, sizeof(bits));
  return bits;
}
PMSP_HD float float_of(std::uint32_t bits) {
  float value = 0.0F;
  ::memcpy(&value, &bits, sizeof(value));
  return value;
}

constexpr std::uint32_t kNormalBits = 0xfffU;  ///< of a surfel; the others hold the depth

/// Upper 20 bits: the depth as a float, rounded to 12 bits of mantissa (0.013 %), without its sign. Lower 12 bits: the
/// normal on an octahedron, 6 bits an axis (3 degrees). `depth` > 0. 0 stands for no depth.
PMSP_HD std::uint32_t pack_surfel(float depth, const Vec3<float>& normal) {
  const float sum = max(abs(normal.x) + abs(normal.y) + abs(normal.z), 1e-30F);
  float u = normal.x / sum;
  float v = normal.y / sum;
  if (normal.z < 0.0F) {
    const float folded = (1.0F - abs(v)) * (u < 0.0F ? -1.0F : 1.0F);
    v = (1.0F - abs(u)) * (v < 0.0F ? -1.0F : 1.0F);
    u = folded;
  }
  const std::uint32_t column = static_cast<std::uint32_t>(31.5F * (u + 1.0F) + 0.5F);
  const std::uint32_t row = static_cast<std::uint32_t>(31.5F * (v + 1.0F) + 0.5F);
  const std::uint32_t rounded = bits_of(depth) + (1U << 10U);
  return ((rounded << 1U) & ~kNormalBits) | (column << 6U) | row;
}

PMSP_HD float depth_of_surfel(std::uint32_t surfel) { return float_of((surfel & ~kNormalBits) >> 1U); }

/// Unit.
PMSP_HD Vec3<float> normal_of_surfel(std::uint32_t surfel) {
  float u = static_cast<float>((surfel >> 6U) & 63U) / 31.5F - 1.0F;
  float v = static_cast<float>(surfel & 63U) / 31.5F - 1.0F;
  const float z = 1.0F - abs(u) - abs(v);
  const float fold = max(0.0F - z, 0.0F);
  u += u < 0.0F ? fold : 0.0F - fold;
  v += v < 0.0F ? fold : 0.0F - fold;
  return normalized(Vec3<float>{u, v, z});
}

/// Upper 6 bits: the confidence. Lower 2 bits: the standing.
PMSP_HD std::uint8_t pack_standing(float confidence, Standing standing) {
  const int level = static_cast<int>(63.0F * min(max(confidence, 0.0F), 1.0F) + 0.5F);
  return static_cast<std::uint8_t>((level << 2) | static_cast<int>(standing));
}
PMSP_HD Standing standing_of(std::uint8_t packed) { return static_cast<Standing>(packed & 3U); }
PMSP_HD std::uint8_t with_standing(std::uint8_t packed, Standing standing) {
  return static_cast<std::uint8_t>((packed & 0xfcU) | static_cast<unsigned>(standing));
}
PMSP_HD float confidence_of_standing(std::uint8_t packed) { return static_cast<float>(packed >> 2U) / 63.0F; }

/// Whether a pixel makes a point after the last round.
PMSP_HD bool makes_point(std::uint8_t packed) {
  return standing_of(packed) == Standing::kOwner || standing_of(packed) == Standing::kOpen;
}

/// Place in the order of pixels; smaller is better, equal ones are for the keyframes to settle. Octaves of the
/// footprint first: what is seen from much closer is sampled more finely. Inside an octave the better estimate wins.
/// `footprint`: size of the pixel on a surface across the ray, in the unit that all keyframes share; > 0.
PMSP_HD int rank(float footprint, std::uint8_t standing) {
  return static_cast<int>(((bits_of(footprint) >> 23U) << 6U) + (63U - (static_cast<unsigned>(standing) >> 2U)));
}

/// A keyframe's surfels, in row order.
struct SurfelView {
  const std::uint32_t* surfels;
  const std::uint8_t* standings;
  int width, height;
  float scale;  ///< the keyframe's unit of length in the one that all share
};

PMSP_HD float pixel_angle(const SurfelView& map) { return static_cast<float>(kPi) / static_cast<float>(map.height); }

struct OwnershipLimits {
  float spacing;             ///< points of one surface closer than this are one point [pixels of the dropped one]
  float max_relative_depth;  ///< largest deviation from one surface, however large the expected errors
  float min_cos_normals;     ///< of the normals of one surface
};

/// A keyframe that is asked.
struct OwnershipView {
  SurfelView map;
  Rigid other_from_first;  ///< from the first keyframe's unit of length into the other's: the rotation times `zoom`
  float zoom;              ///< the first keyframe's scale over the other's
  bool before;             ///< of pixels of equal rank the other keyframe's comes first
};

/// Sum of the two points' expected errors (medians) up to which they may lie on one surface.
constexpr float kSameSurfaceErrors = 4.0F;

/// How far along the normal a point may lie off its surface, and how far off it may lie at most to count as on it.
struct OffSurface {
  float error, most;
};
PMSP_HD OffSurface off_surface(float depth, const Vec3<float>& normal, const Vec3<float>& bearing, float confidence,
                               float max_relative_depth) {
  const float across = depth * abs(dot(normal, bearing));
  const float error = error_of_confidence(confidence);
  return {across * sqrt(error * error + kCommonError * kCommonError), across * max_relative_depth};
}

/// A pixel that asks, in its keyframe's frame and unit.
struct Claim {
  Vec3<float> point, normal;
  float reach;  ///< how near an owner stands for it
  OffSurface off;
  int rank;
};

/// `bearing` of the pixel, which is eligible.
PMSP_HD Claim claim_of(const SurfelView& map, int pixel, const Vec3<float>& bearing, const OwnershipLimits& limits) {
  const std::uint32_t surfel = map.surfels[pixel];
  const std::uint8_t standing = map.standings[pixel];
  const float depth = depth_of_surfel(surfel);
  const Vec3<float> normal = normal_of_surfel(surfel);
  const float footprint = depth * pixel_angle(map);
  return {depth * bearing, normal, limits.spacing * footprint,
          off_surface(depth, normal, bearing, confidence_of_standing(standing), limits.max_relative_depth),
          rank(map.scale * footprint, standing)};
}

/// What another keyframe says of a claim.
struct Answer {
  bool owned;  ///< one of its owners stands for the pixel
  bool open;   ///< one of its pixels would that may still become one
};

/// However finely another keyframe sees the place, no more of its pixels are looked at than within this many.
constexpr float kMaxReach = 4.0F;

/// `grid`: of the other's map.
PMSP_HD Answer ask(const Claim& claim, const OwnershipView& other, const GridView& grid,
                   const OwnershipLimits& limits) {
  const Vec3<float> p = transform(other.other_from_first, claim.point);
  const float range = sqrt(dot(p, p));
  const float angle = pixel_angle(other.map);
  constexpr float kNearer = 0.9F;  // what may own the place is hardly nearer than the point
  if (rank(kNearer * other.map.scale * range * angle, 0xff) > claim.rank) return {false, false};
  const float spacing = min(other.zoom * claim.reach / (range * angle), kMaxReach);
  const Vec3<float> normal = (1.0F / other.zoom) * rotate(other.other_from_first, claim.normal);
  Answer answer{false, false};
  for_each_covered(p, spacing, grid.cos_lat, other.map.width, other.map.height, [&](int pixel) {
    const std::uint8_t packed = other.map.standings[pixel];
    if (answer.owned || !makes_point(packed)) return;
    const std::uint32_t surfel = other.map.surfels[pixel];
    const float depth = depth_of_surfel(surfel);
    const int other_rank = rank(other.map.scale * depth * angle, packed);
    if (other_rank > claim.rank || (other_rank == claim.rank && !other.before)) return;
    const Vec3<float> there = normal_of_surfel(surfel);
    if (dot(there, normal) < limits.min_cos_normals) return;
    const Vec3<float> bearing = bearing_at(grid, pixel % other.map.width, pixel / other.map.width);
    const Vec3<float> apart = fma(depth, bearing, -1.0F * p);
    const OffSurface off =
        off_surface(depth, there, bearing, confidence_of_standing(packed), limits.max_relative_depth);
    const float tolerance = min(kSameSurfaceErrors * (other.zoom * claim.off.error + off.error),
                                max(other.zoom * claim.off.most, off.most));
    if (min(abs(dot(apart, there)), abs(dot(apart, normal))) > tolerance) return;
    (standing_of(packed) == Standing::kOwner ? answer.owned : answer.open) = true;
  });
  return answer;
}

/// Keyframes that can be asked: one bit each.
constexpr int kMaxViewers = 32;

/// A round for one pixel of a keyframe; a stage. Pixels that are not open keep their standing.
struct OwnershipRound {
  SurfelView map;               ///< what the round before left, as `others` are
  GridView grid;                ///< of all maps
  const OwnershipView* others;  ///< `count` of them, kMaxViewers at most
  int count;
  OwnershipLimits limits;
  std::uint32_t* asked;     ///< bits of those whose say still matters; each round clears some
  std::uint8_t* standings;  ///< after this round

  PMSP_HD void operator()(int column, int row) const {
    const int pixel = row * map.width + column;
    const std::uint8_t before = map.standings[pixel];
    standings[pixel] = before;
    if (standing_of(before) != Standing::kOpen) return;
    const Claim claim = claim_of(map, pixel, bearing_at(grid, column, row), limits);
    const std::uint32_t to_ask = asked[pixel];
    std::uint32_t open = 0;
    for (int k = 0; k < count; ++k) {
      if (((to_ask >> static_cast<unsigned>(k)) & 1U) == 0U) continue;
      const Answer answer = ask(claim, others[k], grid, limits);
      if (answer.owned) {
        standings[pixel] = with_standing(before, Standing::kDropped);
        return;
      }
      if (answer.open) open |= 1U << static_cast<unsigned>(k);
    }
    asked[pixel] = open;
    if (open == 0U) standings[pixel] = with_standing(before, Standing::kOwner);
  }
};

/// A keyframe that may have looked through a point.
struct Viewer {
  SightView sight;
  Rigid other_from_first;  ///< as in OwnershipView
  float zoom;              ///< as there
  bool may_own;            ///< it is asked about ownership, too
};

constexpr int kSightCell = 2;  ///< pixels of the map along the side of a cell of its SightView

/// What a viewer says of a point.
template <class F>
struct Look {
  Sight<F> sight;  ///< with weights in the first keyframe's unit
  MaskOf<F> near;  ///< it has the point on its surface and the centre of a pixel within reach
};

/// `depth` of the point, which is not the place of the other camera; `spacing` as in OwnershipLimits. One projection
/// serves both questions. The maps of both keyframes have one size.
template <class F>
PMSP_HD Look<F> look(const Vec3<F>& point, const F& depth, const Viewer& viewer, const SightLimits& limits,
                     float spacing) {
  const Vec3<F> p = transform(viewer.other_from_first, point);
  const F square = max(dot(p, p), F(1e-30F));
  const F range = sqrt(square);
  const SightView& map = viewer.sight;
  const Pixel<F> at =
      project(p, F(static_cast<float>(kSightCell * map.width)), F(static_cast<float>(kSightCell * map.height)));
  constexpr float kCells = 1.0F / static_cast<float>(kSightCell);
  const IntOf<F> index = row(F(kCells) * at.y, map.height) * IntOf<F>(map.width) + column(F(kCells) * at.x, map.width);
  const F nearest = gather<F>(map.nearest, index);
  const F farthest = gather<F>(map.farthest, index);
  const auto on_surface = (range >= nearest * F(limits.min_near)) & (range <= farthest * F(limits.max_far));
  const auto through = range < nearest * F(limits.min_through);  // false where nothing is known
  const F weight = F(viewer.zoom * viewer.zoom) / square;
  // The pixel that the point falls into has the nearest centre. A little more than the reach: at the poles a row's
  // columns are counted with the latitude of the row's centre.
  const F dx = at.x - whole(at.x) - F(0.5F);
  const F dy = at.y - whole(at.y) - F(0.5F);
  const F reach = F(1.1F * spacing * viewer.zoom) * depth / range;
  const F square_cos = fma(p.x, p.x, p.z * p.z) / square;
  const MaskOf<F> near = on_surface & (fma(dx * dx, square_cos, dy * dy) <= reach * reach);
  return {{select(on_surface, weight, F(0)), select(through, weight, F(0))}, near};
}

/// Whether a pixel's point is eligible; a stage. Viewers speak for and against it, each with the inverse square of its
/// distance, the keyframe itself for it. Where they speak for it, the surfel gets its standing and confidence.
struct Eligibility {
  const float* depths;       ///< of the fused points; 0 = none
  const float* confidences;  ///< of the maps
  GridView grid;
  int width;
  const Viewer* viewers;  ///< `count` of them, kMaxViewers at most
  int count;
  SightLimits limits;
  float spacing;  ///< as in OwnershipLimits
  float max_contradiction;
  std::uint8_t* standings;  ///< kOpen or kNone
  float* scaled;            ///< confidences times the share that speaks for the point; 0 = not eligible
  std::uint32_t* asked;     ///< bits of the viewers that may own the point's place

  PMSP_HD void operator()(int column, int row) const {
    const int pixel = row * width + column;
    const float depth = depths[pixel];
    standings[pixel] = 0;
    scaled[pixel] = 0.0F;
    asked[pixel] = 0;
    if (!(depth > 0.0F)) return;
    const Vec3<float> point = depth * bearing_at(grid, column, row);
    float on_surface = 1.0F / (depth * depth);
    float through = 0.0F;
    std::uint32_t owners = 0;
    for (int k = 0; k < count; ++k) {
      const Viewer& viewer = viewers[k];
      const Look<float> seen = look(point, depth, viewer, limits, spacing);
      on_surface += seen.sight.on_surface;
      through += seen.sight.through;
      if (viewer.may_own && seen.near) owners |= 1U << static_cast<unsigned>(k);
    }
    if (through > max_contradiction * on_surface) return;
    const float confidence = confidences[pixel] * on_surface / (on_surface + through);
    standings[pixel] = pack_standing(confidence, Standing::kOpen);
    scaled[pixel] = confidence;
    asked[pixel] = owners;
  }
};

}  // namespace pmsp::kernels
