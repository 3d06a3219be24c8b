// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "pmsp/depth_map.h"
#include "pmsp/executor.h"
#include "pmsp/filters.h"
#include "pmsp/image.h"
#include "pmsp/options.h"
#include "pmsp/point_cloud.h"
#include "pmsp/transform.h"

namespace pmsp {

/// How far a keyframe has seen: what is kept of its depth map for the rest of the mission, two bytes a pixel. One cell
/// stands for 2 x 2 pixels.
struct SightMap {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added
  Image<float> nearest;           ///< smallest depth in the cell [scene units]; 0 = none known
  Image<float> farthest;          ///< largest depth
};

/// `map`: after the consistency filter, of even size.
SightMap sight_map(const DepthMap& map, const Executor& executor);

/// Removes floaters: points that other keyframes have looked through. Each of `others` has the point on its surface
/// (within `max_relative_depth`), or has seen a surface behind it (farther than `min_relative_gap` behind), or has no
/// say. Both sides are added up, each keyframe with the inverse square of its distance from the point, the cloud's own
/// one among those that confirm; a point stays while what speaks against it is at most `max_contradiction` of what
/// speaks for it. What stays has its confidence scaled by the share that speaks for it.
///
/// All `others` are asked: a plan (pmsp/plan.h) says which are worth it. Throws InvalidOption.
void free_space_filter(KeyframeCloud& cloud, const std::vector<const SightMap*>& others,
                       const FreeSpaceOptions& options, const Executor& executor, FilterStats* stats = nullptr);

}  // namespace pmsp
