// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <optional>

#include "pmsp/options.h"

namespace pmsp::tool {

/// Whether planes are worth keeping for a run after a kill: from a GPU they come faster than a disk takes them, and are
/// made again in less time than it takes to read and check them.
class PlanesPace {
 public:
  /// DuplicateCandidates for each keyframe whose planes are about to be made. `options`: those in force.
  bool is_worth_keeping(const DensifierOptions& options);

 private:
  using Clock = std::chrono::steady_clock;

  std::optional<Clock::time_point> first_;  ///< when the first ones were made, which tell no pace, and
  double bytes_ = 0.0;                      ///< of planes since then
};

}  // namespace pmsp::tool
