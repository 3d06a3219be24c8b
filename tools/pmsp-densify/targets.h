// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "arguments.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// Refuses what the run could not write, or would write over an input or over another of its outputs. To be called
/// before any work: a run of hours must not end in front of a file that it may not replace. `own`: what runs with the
/// same workspace have written, which may be replaced. Throws UsageError, OutputError.
void check_targets(const Arguments& arguments, const std::vector<std::filesystem::path>& own = {});

/// The part of it that looks at names alone, not at what is there. Throws UsageError.
void check_names(const Arguments& arguments);

/// What a run writes besides its workspace.
std::vector<std::filesystem::path> target_paths(const Arguments& arguments);

/// Outputs of the last finished run with this workspace, which check_targets() lets a run replace.
std::vector<std::filesystem::path> recorded_outputs(const Arguments& arguments, const workspace::Workspace& workspace);

/// One spelling for each place, whether something is there or not.
std::filesystem::path place_of(const std::filesystem::path& path);

}  // namespace pmsp::tool
