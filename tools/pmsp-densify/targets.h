// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "arguments.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// Rejects outputs that cannot be written, or would overwrite an input or each other. To be called before any work, so
/// that a long run does not fail at its end. `own`: outputs of previous runs with the same workspace, which may be
/// replaced. Throws UsageError, OutputError.
void check_targets(const Arguments& arguments, const std::vector<std::filesystem::path>& own = {});

/// The part of check_targets that depends on names only, not on existing files. Throws UsageError.
void check_names(const Arguments& arguments);

/// Outputs of a run besides its workspace.
std::vector<std::filesystem::path> target_paths(const Arguments& arguments);

/// Outputs of the last finished run with this workspace, which check_targets() allows to replace.
std::vector<std::filesystem::path> recorded_outputs(const Arguments& arguments, const workspace::Workspace& workspace);

/// Canonical form of a path, existing or not.
std::filesystem::path place_of(const std::filesystem::path& path);

}  // namespace pmsp::tool
