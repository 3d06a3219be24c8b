// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine.h"
#include "plan/moves.h"
#include "plan/plan.h"
#include "pmsp/live.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// Input of a result: another keyframe's result, and the poses of both keyframes at that time.
struct LiveInput {
  std::int64_t id;        ///< of the other keyframe
  std::uint64_t version;  ///< number of its result, see LiveNode::planes_version
  KeyframePose other, own;
};
using LiveInputs = std::vector<LiveInput>;

/// Returns the displacement since then of points at `distance` [unit of `own`] in the other keyframe's view [px of
/// `width`]. `other`, `own`: current poses.
inline double moved_px(const LiveInput& then, const KeyframePose& other, const KeyframePose& own, double distance,
                       int width) {
  return moved_px({then.other, then.own}, {other, own}, distance, width);
}

/// Returns the same displacement [rad].
inline double moved_angle(const LiveInput& then, const KeyframePose& other, const KeyframePose& own, double distance) {
  return moved_angle({then.other, then.own}, {other, own}, distance);
}

/// Phase of a keyframe; docs/architecture.md draws the transitions.
enum class LivePhase {
  kPending,   ///< pose not yet stable; holds its image
  kSelected,  ///< accepted by the view filter; candidates for its source views are incomplete
  kMatching,  ///< has source views: gets a depth map and points
  kNoDepth,   ///< no source view or no depth range: source view of others only
  kFrozen     ///< depth map released; points are only moved
};

/// Causes of stale results, see LiveBuilder::invalidate.
enum class LiveCause {
  kDepthMap,   ///< a depth map near it was replaced, added or removed
  kView,       ///< a viewer or duplicate view was erased or has left the map
  kInputs,     ///< inputs of its points have moved
  kOverlap,    ///< a keyframe of its map has moved in the world: other keyframes may overlap
  kNewPoints,  ///< its points are published again; duplicates beyond the fusion window must be searched again
  kRig,        ///< a rig mask was found
  kLenses      ///< a lens distance was found
};

/// Stale results of a keyframe.
struct LiveStale {
  /// Last displacement of its source views since the last photometric pass, if above `max_move_px`; 0 = valid [px].
  double planes_px = 0.0;
  bool points = false;      ///< published points
  bool duplicates = false;  ///< duplicates beyond the fusion window
};

/// A keyframe of a live mission, from its arrival to its removal.
struct LiveNode {
  LivePhase phase = LivePhase::kPending;
  std::int64_t id = 0;
  std::int64_t map_id = 0;
  std::uint64_t serial = 0;  ///< see LiveBuilder::add
  KeyframePose pose;
  LiveImage image;                                  ///< released when it is prepared
  double pose_error = 0.0;                          ///< see Keyframe
  std::shared_ptr<const Image<float>> prior_depth;  ///< released with `image`; nullptr = none
  std::unique_ptr<Engine::Frame> preview;           ///< of LivePreview's engine; nullptr unless it is one of the newest
  std::vector<Landmark> landmarks_cam;  ///< observed landmarks [camera frame, keyframe's unit], independent of the pose
  double landmark_distance = 0.0;       ///< median distance of these [keyframe's unit]; 0 = no landmarks

  // Stability of the pose.
  int newer = 0;         ///< number of later keyframes of its map
  bool at_rest = false;  ///< moved by at most `stable_move` between the last two `add` of its map
  Eigen::Vector3d newest_center = Eigen::Vector3d::Zero();  ///< camera centre at the last `add` of its map

  // Since kSelected.
  SharpnessRecord sharpness;
  std::unique_ptr<Engine::Frame> frame;  ///< nullptr if kFrozen
  bool has_image = false;                ///< can be matched and serve as source view

  // Since kMatching.
  std::vector<std::int64_t> near;  ///< ids of source views; some may be erased
  DepthRange depth_range;          ///< [keyframe's unit]
  LiveStale stale;
  int passes = 0;  ///< completed passes of PatchMatch, without extra photometric ones
  /// Displacement before the last extra photometric pass, which corrects it only partly [px].
  double extra_pass_px = 0.0;
  bool last_pass_was_extra = false;  ///< the last pass was an extra photometric one
  bool is_rematched = false;         ///< matched again from the first pass, until points of all passes are published
  std::uint64_t planes_version = 0;  ///< numbers of results, increasing over all keyframes; 0 = none
  std::uint64_t filtered_version = 0;
  std::uint64_t fused_version = 0;
  LiveInputs matched_inputs;  ///< inputs of the last photometric pass
  /// Inputs of the consistency filter, of fusion, and of the points (viewers and duplicate views).
  LiveInputs filtered_inputs, fused_inputs, tested_inputs;
  std::vector<std::int64_t> viewers, duplicate_views;  ///< ids
  KeyframePose first_pose;                             ///< pose when points were first published
  int published_passes = 0;                            ///< number of passes of the published points; 0 = none
  KeyframePose beyond_window_pose;                     ///< pose at the last duplicate removal beyond the window
  bool beyond_window = false;                          ///< duplicate views extend beyond the fusion window

  /// Returns the displacement that running all passes again would correct [px].
  double rematch_px() const { return std::max(stale.planes_px, extra_pass_px); }
  bool lacks_first_pass() const {
    return phase == LivePhase::kSelected || (phase == LivePhase::kMatching && passes == 0);
  }
  bool used() const { return phase != LivePhase::kPending; }
  bool has_depth_map() const { return planes_version != 0 && frame; }

  /// Whether an extra photometric pass is due: source views have moved by more than `tolerance_px` since the last
  /// photometric pass. Never twice in a row, nor before the second pass.
  bool needs_photometric_pass(double tolerance_px) const {
    return passes > 1 && stale.planes_px > tolerance_px && !last_pass_was_extra;
  }
  /// Returns the keyframe at its current pose, with landmarks [map units], without image.
  Keyframe keyframe() const;
  /// Returns the same with prior depth, mask (nullptr = none) and image, a view of its own pixels or of `converted`.
  Keyframe keyframe(const Image<std::uint8_t>* mask, Image<Rgb>& converted) const;
  void take_landmarks(const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world);
};

}  // namespace pmsp
