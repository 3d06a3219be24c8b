// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "plan/plan.h"
#include "pmsp/options.h"
#include "util/io_api.h"

namespace pmsp {

/// How many used keyframes before and after its own an entry of a flight's plan names at most.
struct PlanReach {
  std::int64_t near;            ///< neighbours, on either side
  std::int64_t consistency;     ///< consistency window, on either side
  std::int64_t fusion;          ///< fusion window, on either side
  std::int64_t windows;         ///< the wider one
  std::int64_t viewers_before;  ///< the fusion window's keyframes are viewers, too
  std::int64_t viewers_after;
  std::int64_t duplicate_views;  ///< on either side
};

/// `options`: valid.
PMSP_IO_API PlanReach plan_reach(const DensifierOptions& options);

/// Whether keyframes beyond the fusion window may make the point of a place.
bool searches_whole_mission(const DensifierOptions& options);

/// Rounds in which that is decided. Two decide nine pixels in ten where only the fusion window is asked; those that are
/// open then are kept. Each makes the points of a flight later by as many keyframes as are asked ahead.
int duplicate_rounds(const DensifierOptions& options);

}  // namespace pmsp
