// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

#include "pmsp/options.h"

namespace pmsp::cuda {

/// Device memory that a Densifier with these options takes at most [bytes]; sizes must be filled in. Builds without
/// CUDA know it, too.
std::size_t memory_needed(const DensifierOptions& options);

}  // namespace pmsp::cuda
