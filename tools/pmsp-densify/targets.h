// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "arguments.h"

namespace pmsp::tool {

/// Refuses what the run could not write, or would write over an input or over another of its outputs. To be called
/// before any work: a run of hours must not end in front of a file that it may not replace. Throws UsageError,
/// OutputError.
void check_targets(const Arguments& arguments);

}  // namespace pmsp::tool
