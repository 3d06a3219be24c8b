// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmsp/types.h"
#include "util/io_api.h"

// A monocular SLAM closes a loop by similarities, one for each keyframe, and keeps of each its rotation and translation
// only (stella_vslam, ORB-SLAM3: the graph is optimised over Sim(3), and the translation divided by the scale). What
// hangs on a keyframe must be scaled all the same. The scale shows in two places: in the baselines to keyframes around,
// and in the distances of the landmarks that the keyframe observes. Both are noisy, and each may lie: baselines of a
// hover, landmarks that were made anew.
namespace pmsp {

/// A keyframe that a SLAM has moved.
struct MovedKeyframe {
  KeyframePose before;   ///< with the scale that was right then
  RigidTransform after;  ///< translation in the world's unit
  /// Of landmarks that it observed before and observes still, the distance from the camera before and after, in the
  /// world's unit. May be empty.
  std::vector<double> ranges_before, ranges_after;
  std::int64_t world_before = 0;  ///< keyframes that were in two worlds tell nothing of each other
};

/// What a keyframe sees again of the landmarks that it saw before: distances, by ascending `landmark` ids.
template <class Range>
void compare_ranges(const std::vector<Range>& before, const std::vector<Range>& after, MovedKeyframe& keyframe) {
  auto then = before.begin();
  for (const Range& now : after) {
    while (then != before.end() && then->landmark < now.landmark) ++then;
    if (then == before.end() || then->landmark != now.landmark) continue;
    keyframe.ranges_before.push_back(then->range);
    keyframe.ranges_after.push_back(now.range);
  }
}

/// Keyframes before and after a keyframe whose baselines count, on either side.
constexpr std::size_t kScaleReach = 5;

/// The scales of the keyframes after they were moved, 1 / kMaxScale to kMaxScale. `keyframes`: in the order of flight,
/// of one map; those that have not moved belong to it, too. Each scale is a function of the keyframes within 2 *
/// kScaleReach places of its own.
///
/// Baselines and landmarks each give a robust mean of log ratios and how far it may be off. Where both agree, they are
/// averaged; where not, the one that goes with the keyframes around counts. What is no more than its own error changes
/// nothing: bundle adjustments that only shake the poses leave scales as they are.
PMSP_IO_API std::vector<double> recover_scales(const std::vector<MovedKeyframe>& keyframes);

}  // namespace pmsp
