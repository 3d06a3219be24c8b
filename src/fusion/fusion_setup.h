// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "duplicates.h"
#include "fused_point.h"
#include "pmsp/options.h"
#include "pmsp/stages.h"
#include "ranges.h"

// Parameters of the fusion kernels, for all backends.
namespace pmsp {

/// Bytes per pixel for the agreement of all other maps of a window.
inline int agree_bytes(const FusionOptions& options) { return (options.window - 1 + 7) / 8; }

kernels::FusionLimits fusion_limits(const FusionOptions& options);
kernels::DuplicateLimits duplicate_limits(const FusionOptions& options);
kernels::FreeSpaceLimits free_space_limits(const FreeSpaceOptions& options);

}  // namespace pmsp
