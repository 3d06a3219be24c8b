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

/// What a stage looked at: a keyframe, which of its results, and where both keyframes were then.
struct LiveInput {
  std::int64_t id;
  std::uint64_t made;
  KeyframePose other, own;
};
using LiveInputs = std::vector<LiveInput>;

/// By how much what a keyframe sees has moved since then; `other`, `own`: where both are now.
inline double moved_px(const LiveInput& then, const KeyframePose& other, const KeyframePose& own, double range,
                       int width) {
  return moved_px({then.other, then.own}, {other, own}, range, width);
}

/// The same [rad]: for what is shifted, a share of the range.
inline double moved_angle(const LiveInput& then, const KeyframePose& other, const KeyframePose& own, double range) {
  return moved_angle({then.other, then.own}, {other, own}, range);
}

/// A keyframe of a live mission, from its arrival to its removal.
struct LiveNode {
  std::int64_t id = 0;
  std::int64_t map_id = 0;
  std::uint64_t serial = 0;  ///< see LiveBuilder::add
  KeyframePose pose;
  LiveImage image;                                  ///< until it is prepared, or not needed
  double pose_error = 0.0;                          ///< Keyframe's
  std::shared_ptr<const Image<float>> prior_depth;  ///< as long; null = none
  std::vector<Landmark> seen;                       ///< positions in the camera's frame and unit: they go with the pose
  double range = 0.0;                               ///< median distance of these; 0 = there are none

  // Ripeness.
  int newer = 0;                                     ///< keyframes that have come since
  bool still = false;                                ///< it hardly moved while the last one of them came
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< when that one came

  // Decided when it is ripe.
  bool used = false;
  SharpnessRecord sharpness;

  // Of used ones.
  std::unique_ptr<Engine::Frame> frame;  ///< gone when it is frozen
  bool has_image = false;                ///< it can be matched with
  bool linked = false;                   ///< `near` and `depths` are known
  std::vector<std::int64_t> near;        ///< ids; some may have been erased since
  DepthRange depths;                     ///< [keyframe's unit]
  bool has_depth = false;                ///< it gets a depth map
  int passes = 0;                        ///< of PatchMatch that it has been through
  double moved_px = 0.0;                 ///< by how much neighbours have moved since `matched`, where that is too much
  double deferred_px = 0.0;              ///< by how much they had moved when a pass in between made up for it
  bool had_in_between = false;           ///< the last pass was for that
  bool restarted = false;                ///< all passes are done again
  std::uint64_t planes_made = 0;         ///< numbers of results; newer ones are higher, 0 = there is none
  std::uint64_t filtered_made = 0;
  std::uint64_t fused_made = 0;
  LiveInputs matched;                                  ///< what the last pass looked at that looked at images alone
  LiveInputs filtered, fused, tested;                  ///< what went into these, and into the points
  std::vector<std::int64_t> viewers, duplicate_views;  ///< asked about its points
  KeyframePose first_pose;                             ///< when its points were first shown
  int shown = 0;                                       ///< passes that its points had; 0 = it has none
  bool points_due = false;                             ///< something has changed for them since
  KeyframePose wide_pose;                              ///< when they were last asked
  bool wide = false;                                   ///< keyframes beyond the fusion window were asked about them
  bool wide_due = false;                               ///< should be

  double displacement_px() const {
    return std::max(moved_px, deferred_px);
  }                                                           ///< what all passes anew would put right [px]
  bool has_map() const { return planes_made != 0 && frame; }  ///< its depth map is there

  /// For its next pass, since its map is of before a move by more than `tolerance_px`; but not twice in a row, nor
  /// before it has had the two passes that first points take.
  bool wants_images_alone(double tolerance_px) const {
    return passes > 1 && moved_px > tolerance_px && !had_in_between;
  }
  /// With landmarks in the world, as the pose is now; without image.
  Keyframe keyframe() const;
  /// The same with image, a view of its own pixels or of `converted`, prior depth and mask (null = none).
  Keyframe keyframe(const Image<std::uint8_t>* mask, Image<Rgb>& converted) const;
  void take_landmarks(const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world);
};

}  // namespace pmsp
