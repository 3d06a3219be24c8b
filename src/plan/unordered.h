// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "plan/choices.h"
#include "plan/plan.h"

namespace pmsp {

/// Returns the entries of an unordered set, in input order; see make_plan.
std::vector<PlanEntry> plan_unordered(std::vector<PlanKeyframe> keyframes, const DensifierOptions& options,
                                      const PreviousPlan& previous);

}  // namespace pmsp
