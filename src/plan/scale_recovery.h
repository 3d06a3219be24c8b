// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/types.h"

// Monocular SLAMs close a loop by one similarity per keyframe but keep only its rotation and translation (stella_vslam,
// ORB-SLAM3: the graph is optimised over Sim(3), and the translation divided by the scale). Data in the frame of a
// keyframe must be scaled nevertheless. The scale is estimated from baselines to surrounding keyframes and from ranges
// of observed landmarks. Both are noisy and can be wrong: baselines of a hover, landmarks that were created again.
namespace pmsp {

/// Keyframe moved by a SLAM.
struct MovedKeyframe {
  KeyframePose before;   ///< with the scale at that time
  RigidTransform after;  ///< translation in map units
  /// Distances from the camera, before and after, of landmarks observed at both times [map units]. May be empty.
  std::vector<double> ranges_before, ranges_after;
  std::int64_t map_before = 0;  ///< map at that time; keyframes of different maps are not compared
};

/// Adds the distances of landmarks observed both before and after; lists by ascending `landmark`.
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

/// Number of keyframes on either side whose baselines are used.
constexpr std::size_t kScaleReach = 5;

/// Returns the scales of the keyframes after a move, 1 / kMaxScale to kMaxScale. `keyframes`: of one map, in temporal
/// order, including unmoved ones. Each scale depends on the keyframes within 2 * kScaleReach places.
///
/// Baselines and landmarks each give a robust mean of log ratios with its standard error. If they agree, they are
/// averaged, else the one closer to the surrounding keyframes is used. Insignificant changes are ignored: bundle
/// adjustments with random changes of poses keep the scales.
PMSP_API std::vector<double> recover_scales(const std::vector<MovedKeyframe>& keyframes);

}  // namespace pmsp
