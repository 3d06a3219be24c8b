// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "plan/plan.h"
#include "pmsp/api.h"
#include "pmsp/options.h"

namespace pmsp {

/// Maximum distance of an entry to the keyframes in its lists, for sequences [used keyframes].
struct PlanReach {
  std::int64_t near;            ///< source views, on either side
  std::int64_t consistency;     ///< consistency window, on either side
  std::int64_t fusion;          ///< fusion window, on either side
  std::int64_t windows;         ///< the larger one of the two
  std::int64_t viewers_before;  ///< including the fusion window
  std::int64_t viewers_after;
  std::int64_t duplicate_views;  ///< on either side
};

/// `options`: valid.
PMSP_API PlanReach plan_reach(const DensifierOptions& options);

/// Whether duplicates are searched beyond the fusion window.
bool searches_whole_mission(const DensifierOptions& options);

/// Returns the number of rounds of duplicate removal. Two decide most pixels if only the fusion window is searched;
/// pixels that stay open are kept. Each round delays the points of a sequence by `PlanReach::duplicate_views`
/// keyframes.
int duplicate_rounds(const DensifierOptions& options);

}  // namespace pmsp
