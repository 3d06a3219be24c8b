// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/options.h"

namespace pmsp::tool {

constexpr int kPaceWidth = 80;  ///< of the depth maps and images that the pace is measured with

/// How fast one thread of this machine's CPU works with some options [s].
struct CpuPace {
  double matching = 0.0;   ///< for a pixel and a view that it is matched with: PatchMatch, all passes
  double rest = 0.0;       ///< for a pixel of a depth map: all other stages but ownership; larger maps take less
  double ownership = 0.0;  ///< for a pixel and a keyframe that is asked who makes the point of a place
};

/// Densifies a few small panoramas of an analytic box with all stages that `options` ask for, on one thread: about a
/// second.
CpuPace measure_cpu_pace(const DensifierOptions& options);

}  // namespace pmsp::tool
