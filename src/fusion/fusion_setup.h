// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "duplicates.h"
#include "fused_point.h"
#include "pmsp/options.h"
#include "pmsp/stages.h"
#include "ranges.h"

// What the kernels of fusion are given, on every machine.
namespace pmsp {

/// Bytes for each pixel that say which other maps of a whole window agree.
inline int agree_bytes(const FusionOptions& options) { return (options.window - 1 + 7) / 8; }

kernels::FusionLimits fusion_limits(const FusionOptions& options);
kernels::DuplicateLimits duplicate_limits(const FusionOptions& options);
kernels::FreeSpaceLimits free_space_limits(const FreeSpaceOptions& options);

}  // namespace pmsp
