// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/options.h"

namespace pmsp::tool {

constexpr int kPaceWidth = 80;  ///< width of depth maps and images for the measurement [px]

/// Single-thread speed of this CPU with certain options [s].
struct CpuPace {
  double matching = 0.0;  ///< per pixel and source view: all passes of PatchMatch
  double rest = 0.0;      ///< per pixel of a depth map: other stages except duplicate removal; less for larger maps
  double duplicate_removal = 0.0;  ///< duplicate removal, per pixel and viewer
};

/// Measures the speed: densifies some small panoramas of an analytic box on one thread, with all stages enabled in
/// `options`. Takes about a second.
CpuPace measure_cpu_pace(const DensifierOptions& options);

}  // namespace pmsp::tool
