// SPDX-License-Identifier: BSD-2-Clause
#include "plan/reach.h"

#include <algorithm>

#include "patchmatch/neighbours.h"

namespace pmsp {

bool searches_whole_mission(const DensifierOptions& options) {
  return options.advanced.free_space.enabled && options.advanced.free_space.whole_mission;
}

PlanReach plan_reach(const DensifierOptions& options) {
  PlanReach reach{};
  reach.near = neighbour_reach(options.advanced.patchmatch.neighbours);
  reach.consistency = options.advanced.consistency.enabled ? options.advanced.consistency.window / 2 : 0;
  reach.fusion = options.advanced.fusion.window / 2;
  reach.windows = std::max(reach.consistency, reach.fusion);
  reach.viewers_before = reach.viewers_after = reach.duplicate_views = reach.fusion;
  if (options.advanced.free_space.enabled) {
    const std::int64_t half = options.advanced.free_space.history / 2;
    reach.viewers_before = std::max(reach.fusion, half);
  }
  if (searches_whole_mission(options)) {
    reach.viewers_after = reach.viewers_before;
    reach.duplicate_views =
        std::min(reach.viewers_before, std::max<std::int64_t>(reach.fusion, options.advanced.fusion.history / 2));
  }
  return reach;
}

int duplicate_rounds(const DensifierOptions& options) {
  if (options.advanced.fusion.spacing_px == 0.0) return 0;
  return searches_whole_mission(options) ? 4 : 2;
}

}  // namespace pmsp
