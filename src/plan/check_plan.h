// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "plan/plan.h"
#include "pmsp/options.h"

namespace pmsp {

/// Checks that stages can run a plan with these (valid) options. Throws InvalidInput, naming keyframe and list:
/// duplicate ids; lists with keyframes that are missing, lack the required data or are listed twice; lists that are
/// longer or reach farther than those of make_plan with these options; depth maps without neighbour or depth range.
void check_plan(const Plan& plan, const DensifierOptions& options);

}  // namespace pmsp
