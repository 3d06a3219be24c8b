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

/// Sharpness of an image at up to 256 landmarks of its keyframe, so that a plan needs no pixels. Empty = unknown:
/// counts as sharp.
struct SharpnessRecord {
  std::vector<LandmarkSharpness> landmarks;  ///< ascending id, without those near the poles or on untextured surfaces
};

/// Returns the sharpness of a keyframe's image; empty without image. `width`: of the depth maps, whose pixels are the
/// unit of blur [px]; 0 = of the image. `executor`: nullptr = this thread.
PMSP_API SharpnessRecord record_sharpness(const Keyframe& keyframe, int width, const Executor* executor = nullptr);

/// Input of a plan: a keyframe without its image.
struct PlanKeyframe {
  std::int64_t id = 0;
  RigidTransform cam_from_world;  ///< as in Keyframe
  std::vector<Landmark> landmarks;
  SharpnessRecord sharpness;
};

/// Returns the keyframe without image and mask; `sharpness` is set if there is an image and `options` enable the test
/// for blur. `executor`: nullptr = this thread.
PMSP_API PlanKeyframe plan_keyframe(const Keyframe& keyframe, const DensifierOptions& options,
                                    const Executor* executor = nullptr);

/// Use of a keyframe, or reason for its rejection.
enum class KeyframeUse {
  kDepthMap,           ///< used: has a depth map and serves as source view
  kNoNeighbour,        ///< used as source view only: no used keyframe near it, at another position
  kNoRange,            ///< used as source view only: no depth range without landmarks
  kTooLittleParallax,  ///< rejected: too close to the newest used keyframe
  kTooMuchParallax,    ///< rejected: too far from it
  kNoLandmarks,        ///< rejected: unknown view, without landmarks
  kBlurred,            ///< rejected: blurred, with sufficient overlap without it
};

/// Returns "depth map", "no neighbour", "no range", "too little parallax", "too much parallax", "no landmarks" or
/// "blurred".
PMSP_API const char* name_of(KeyframeUse use);
/// Throws InvalidInput for other names.
PMSP_API KeyframeUse keyframe_use_from_name(const std::string& name);

/// Decisions for one keyframe. Lists contain ids of other keyframes: in `near` used ones, else only those with a depth
/// map.
struct PlanEntry {
  std::int64_t id = 0;
  KeyframeUse use = KeyframeUse::kNoLandmarks;
  std::vector<std::int64_t> near;             ///< source views, the most useful first
  std::optional<std::int64_t> first_planes;   ///< keyframe whose planes of the first pass are warped into this one
  DepthRange range;                           ///< [map units]; {0, 0} without landmarks
  std::vector<std::int64_t> consistency;      ///< maps compared by the consistency filter
  std::vector<std::int64_t> fusion;           ///< fusion window, without this keyframe
  std::vector<std::int64_t> viewers;          ///< keyframes of the free-space test
  std::vector<std::int64_t> duplicate_views;  ///< keyframes searched for duplicates

  /// Whether it is a source view at least.
  bool used() const { return use <= KeyframeUse::kNoRange; }
  bool has_depth_map() const { return use == KeyframeUse::kDepthMap; }
};

/// Use and dependencies of all keyframes of a mission.
struct Plan {
  std::vector<PlanEntry> entries;  ///< in the order of the keyframes
};

/// Makes the plan of a mission: a pure function. `keyframes`: in temporal order, or in any order if
/// `options.unordered`. Each decision depends on a neighbourhood only:
/// - Use: keyframes are compared with the newest used one (see ViewFilter). The chain starts again at the first
///   keyframe with landmarks of each block of kViewBlock ids: the next ones are compared with it, even if it is
///   rejected. It is rejected if the previous block has used keyframes besides its first, and its parallax to the
///   newest of them is too small (or it is blurred). A keyframe therefore affects decisions in its own block and the
///   first one of the next block.
/// - Source views (`near`): the most useful parallax among the used keyframes a few before and after.
/// - First planes: those of the previous used keyframe, unless floor(id / init.chain_keyframes) differs.
/// - Windows: used keyframes before and after.
/// - Viewers: the fusion window and `free_space.views` others (32 at most in all), evenly spread over those among
///   `free_space.history` / 2 used keyframes on either side that are within twice the 90th percentile of the ranges of
///   the landmarks. Without `free_space.whole_mission` none after the fusion window.
/// - Duplicate views: with `free_space.whole_mission` as many, selected likewise among `fusion.history` / 2 used
///   keyframes on either side; else the fusion window.
/// In an unordered set all keyframes with landmarks are used, except blurred ones; source views, windows and viewers
/// are selected from the whole set. Source views and windows have common landmarks with the keyframe: source views see
/// most of its view at useful parallax, windows have most common landmarks. There are no first planes.
///
/// `previous`: plan of the same mission before poses moved or keyframes were added; its decisions are kept while nearly
/// as good as new ones.
///
/// Throws InvalidOption; InvalidInput for duplicate ids.
PMSP_API Plan make_plan(const std::vector<PlanKeyframe>& keyframes, const DensifierOptions& options,
                        const Plan* previous = nullptr);

/// Number of ids per chain of the view filter.
constexpr std::int64_t kViewBlock = 64;

/// Dependencies of the points of some keyframes, by artefact, these keyframes included; ids in the order of the plan. P
/// = `patchmatch.geometric_passes`, R = number of rounds of duplicate removal (four with `free_space.whole_mission`,
/// else two; none if `fusion.spacing_px` is 0).
///
/// Points of i require round R of i; round r requires round r - 1 of i and its duplicate views; round 0, the free-space
/// test, filtered planes of i and its fusion window, and range maps of the viewers; a range map filtered planes; these
/// require planes P of the consistency window; planes p require planes p - 1 of i and its source views, and images of
/// these; planes 0 these images and planes 0 of `first_planes`.
///
/// Each set is part of the next one: clouds, rounds from R to 0, filtered, planes from P to 0, images.
struct Halo {
  std::vector<std::int64_t> clouds;               ///< requested ones with points
  std::vector<std::vector<std::int64_t>> rounds;  ///< status after each round, 0 to R; 0 = after the free-space test
  std::vector<std::int64_t> range_maps;
  std::vector<std::int64_t> filtered;             ///< planes after the median and consistency filters
  std::vector<std::vector<std::int64_t>> planes;  ///< after each pass, 0 to P
  std::vector<std::int64_t> images;
};

/// Throws InvalidOption if the chain of first planes is unlimited (`init.warp_previous` with `init.chain_keyframes` 0):
/// parts of a mission then have no halo.
PMSP_API void check_chain(const DensifierOptions& options);

}  // namespace pmsp
