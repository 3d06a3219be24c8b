// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "pmsp/densifier.h"

namespace pmsp::tool {

/// Progress of a run.
struct RunProgress {
  double share = 0.0;           ///< of the expected work, 0 to 1
  std::int64_t depth_maps = 0;  ///< matched
  std::int64_t pixels = 0;      ///< with a depth, in these
  std::int64_t points = 0;      ///< in the cloud so far; most presets hold them back
};

/// `keyframes`: expected total; future ones are assumed to be like previous ones.
RunProgress run_progress_of(const DensifierStats& stats, std::size_t keyframes);

/// Returns "1.2 M" for 1234567.
std::string short_count(std::int64_t count);

/// Returns "37 %, 1 min 05 s left; 8 depth maps, 6.1 M pixels, 210 k points", without zero counts. `seconds_left` < 0:
/// unknown.
std::string run_progress_text(const RunProgress& run_progress, double seconds_left);

}  // namespace pmsp::tool
