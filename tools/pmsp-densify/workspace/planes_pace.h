// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <optional>

#include "pmsp/options.h"

namespace pmsp::tool {

/// Whether planes are worth storing for resumption: a GPU may produce them faster than a disk writes them, and again
/// faster than they are read and verified.
class PlanesPace {
 public:
  /// To be called for each keyframe before its planes are made. `options`: effective ones.
  bool is_worth_keeping(const DensifierOptions& options);

 private:
  using Clock = std::chrono::steady_clock;

  std::optional<Clock::time_point> first_;  ///< time of the first planes, which give no rate
  double bytes_ = 0.0;                      ///< size of planes since then
};

}  // namespace pmsp::tool
