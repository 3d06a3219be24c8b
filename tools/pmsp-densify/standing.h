// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "pmsp/densifier.h"

namespace pmsp::tool {

/// How far a run is.
struct Standing {
  double share = 0.0;           ///< of the work, as far as it can be told
  std::int64_t depth_maps = 0;  ///< matched
  std::int64_t pixels = 0;      ///< of these, with a depth
  std::int64_t points = 0;      ///< in the cloud so far; many qualities hold them back
};

/// `keyframes`: that are expected in all; those to come are taken to be like those that have come.
Standing standing_of(const DensifierStats& stats, std::size_t keyframes);

/// 1234567 as "1.2 M"
std::string short_count(std::int64_t count);

/// "37 %, 1 min 05 s left; 8 depth maps, 6.1 M pixels, 210 k points"; what there is none of is left out. `seconds_left`
/// < 0: not known yet.
std::string standing_text(const Standing& standing, double seconds_left);

}  // namespace pmsp::tool
