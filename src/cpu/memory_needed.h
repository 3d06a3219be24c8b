// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/options.h"

namespace pmsp::cpu {

/// Bytes, at most.
struct MemoryNeeded {
  double memory = 0.0;   ///< without the process itself and what is beside the Densifier
  double scratch = 0.0;  ///< of the scratch file; 0 = there is none
};

/// What a Densifier on the CPU takes that makes points of so many used keyframes, without a mask; sizes must be filled
/// in.
MemoryNeeded memory_needed(const DensifierOptions& options, std::int64_t used);

}  // namespace pmsp::cpu
