// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/options.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// What is recorded of an image, so that a plan needs no pixels: how sharply it shows at most 256 of the keyframe's
/// landmarks. Empty = nothing is known; such an image counts as sharp.
struct SharpnessRecord {
  std::vector<LandmarkSharpness> landmarks;  ///< ascending id, without those near the poles or on bare surfaces
};

/// `width`: of the depth maps, in whose pixels blur counts [px]; 0 = that of the image. Empty for an empty image.
/// `executor`: whose threads share the work; nullptr = this thread alone.
PMSP_API SharpnessRecord record_sharpness(const Keyframe& keyframe, int width, const Executor* executor = nullptr);

/// What a plan is made from: a keyframe without its image.
struct PlanKeyframe {
  std::int64_t id = 0;
  RigidTransform cam_from_world;  ///< as in Keyframe
  std::vector<Landmark> landmarks;
  SharpnessRecord sharpness;
};

/// Without image and mask; `sharpness` from the image where there is one and `options` look for blur. `executor`: as
/// above.
PMSP_API PlanKeyframe plan_keyframe(const Keyframe& keyframe, const DensifierOptions& options,
                                    const Executor* executor = nullptr);

/// What a keyframe is used for, and if for nothing, why.
enum class KeyframeUse {
  kDepthMap,           ///< used: it gets a depth map and lends its image
  kNoNeighbour,        ///< used, but lends its image only: no other used keyframe near it, from another place
  kNoRange,            ///< used, but lends its image only: no landmark tells a depth range
  kTooLittleParallax,  ///< not used: it shows what the newest used one shows, from too near
  kTooMuchParallax,    ///< not used: from too far
  kNoLandmarks,        ///< not used: nothing tells what it sees
  kBlurred,            ///< not used: blurred, and the keyframes around do without it
};

/// "depth map", "no neighbour", "no range", "too little parallax", "too much parallax", "no landmarks" or "blurred".
PMSP_API const char* name_of(KeyframeUse use);
/// Throws InvalidInput for any other.
PMSP_API KeyframeUse keyframe_use_from_name(const std::string& name);

/// What is decided for one keyframe. All lists name keyframes by id, never this one; all but `near` and `far` name
/// those with a depth map only.
struct PlanEntry {
  std::int64_t id = 0;
  KeyframeUse use = KeyframeUse::kNoLandmarks;
  std::vector<std::int64_t> near;             ///< matched with; lend planes and images; the most useful first
  std::optional<std::int64_t> first_planes;   ///< keyframe whose planes of the first pass are warped into this one
  DepthRange range;                           ///< [scene units]; {0, 0} without landmarks
  std::vector<std::int64_t> consistency;      ///< whose planes the consistency filter compares
  std::vector<std::int64_t> fusion;           ///< whose points are joined with this keyframe's
  std::vector<std::int64_t> viewers;          ///< asked who has looked through its points
  std::vector<std::int64_t> duplicate_views;  ///< asked who makes the point of a place

  /// Whether it lends its image at least.
  bool used() const { return use <= KeyframeUse::kNoRange; }
  bool has_depth_map() const { return use == KeyframeUse::kDepthMap; }
};
PMSP_API bool operator==(const PlanEntry& a, const PlanEntry& b);
inline bool operator!=(const PlanEntry& a, const PlanEntry& b) { return !(a == b); }

/// What every keyframe of a mission is used for and which others its results depend on.
struct Plan {
  std::vector<PlanEntry> entries;  ///< in the order of the keyframes that it was made from
};
inline bool operator==(const Plan& a, const Plan& b) { return a.entries == b.entries; }
inline bool operator!=(const Plan& a, const Plan& b) { return !(a == b); }

/// Makes the plan of a mission: a pure function of what is given. `keyframes` come in the order of flight, or in any
/// order where `options.unordered`; every decision looks at a neighbourhood only:
/// - Used or not: each keyframe is compared with the newest used one (see ViewFilter). That chain begins anew at the
///   first keyframe with landmarks of each block of kViewBlock ids, which all that follow in the block are compared
///   with as if it were used. It is itself left out where the block before used others than its first, and it shows too
///   little new against the newest of them (or is blurred). So a keyframe has a say in its own block and on the first
///   of the next one.
/// - Near neighbours: the most useful parallax among the used keyframes a few before and after.
/// - First planes: those of the used keyframe before, unless floor(id / init.chain_keyframes) has changed.
/// - Windows: used keyframes before and after.
/// - Viewers: the fusion window, and `free_space.views` besides (32 at most in all), spread evenly over those among
///   `free_space.history` / 2 used ones on either side that lie within twice the 90th percentile of the ranges of the
///   keyframe's landmarks. Without `free_space.whole_mission` none after the fusion window.
/// - Owners: with `free_space.whole_mission` as many, chosen likewise among `fusion.history` / 2 used ones on either
///   side; else the fusion window.
/// In an unordered set all with landmarks are used but blurred ones; near neighbours, windows and viewers are chosen
/// over the whole set. Near neighbours and windows share landmarks directly with the keyframe: the former see most of
/// what it sees under useful parallax, the latter share most landmarks. There are no first planes.
///
/// `previous`: a plan of the same mission, as it was before poses moved or keyframes came. What was decided there stays
/// while it is nearly as good as what would be decided now.
///
/// Throws InvalidOption, or InvalidInput when an id comes twice.
PMSP_API Plan make_plan(const std::vector<PlanKeyframe>& keyframes, const DensifierOptions& options,
                        const Plan* previous = nullptr);

/// Ids of a block in which the view filter begins anew.
constexpr std::int64_t kViewBlock = 64;

/// Everything that the points of some keyframes depend on, artefact by artefact, what belongs to these keyframes
/// themselves included; ids in the order of the plan. P = `patchmatch.geometric_passes`, R = rounds of ownership (with
/// `free_space.whole_mission` four, else two; none with `fusion.spacing_px` 0).
///
/// points(i) need round R of i; round r those before of i and of its owners; round 0, the eligible points, filtered
/// planes of i and its fusion window, and the range maps of its viewers; ranges(i) filtered(i); filtered(i) planes P of
/// the consistency window; planes p those of pass p - 1 of itself and its near neighbours, and images of these; planes
/// 0 those images and planes 0 of `first_planes`.
///
/// So each of these sets is part of the next one: clouds, rounds from R to 0, filtered, planes from P to 0, images.
struct Halo {
  std::vector<std::int64_t> clouds;               ///< those asked for that get points
  std::vector<std::vector<std::int64_t>> rounds;  ///< standings of pixels' points after each round, 0 to R; 0 = those
                                                  ///< that nobody has looked through
  std::vector<std::int64_t> range_maps;           ///< range maps
  std::vector<std::int64_t> filtered;             ///< planes after the median and consistency filters
  std::vector<std::vector<std::int64_t>> planes;  ///< of each pass, 0 to P
  std::vector<std::int64_t> images;               ///< prepared images
};

/// `options`: those that the plan was made with. `points`: false = what the filtered depth maps of `ids` depend on;
/// `clouds`, `rounds` and `range_maps` then name nobody. Throws InvalidOption where first planes form a chain without
/// end
/// (`init.warp_previous` with `init.chain_keyframes` 0), InvalidInput when the plan lacks one of `ids`, or a keyframe
/// that it names.
PMSP_API Halo halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options,
                   bool points = true);

/// Throws InvalidOption where first planes form a chain without end, so that a part of a mission has no halo of its
/// own.
PMSP_API void refuse_endless_chain(const DensifierOptions& options);

}  // namespace pmsp
