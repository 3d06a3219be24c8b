// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "plan/plan.h"
#include "pmsp/options.h"

namespace pmsp {

/// Whether stages that run a plan with these (valid) options find what it names, and no more than they have room for.
/// Throws InvalidInput, naming keyframe and list: an id comes twice; a list names a keyframe that is not there or lacks
/// what it should lend, names one twice, or is longer or reaches farther than make_plan's with these options; a depth
/// map has no neighbour or no depth range.
void check_plan(const Plan& plan, const DensifierOptions& options);

}  // namespace pmsp
