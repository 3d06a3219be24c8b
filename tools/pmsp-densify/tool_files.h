// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "util/numbered_name.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// Formats JSON with indentation.
std::string json_text(const nlohmann::ordered_json& json);

/// Writes a file unless it has this content. Throws OutputError.
void write_if_changed(const std::filesystem::path& path, const std::string& text);

/// Returns paths in a folder, in no order; those before an error.
std::vector<std::filesystem::path> entries_in(const std::filesystem::path& folder);

/// Returns time and size of a file as a line, or that it is missing.
std::string state_of(const std::filesystem::path& file);

/// Returns names and states of all files in a folder, sorted.
std::string state_of_files_in(const std::filesystem::path& folder);

/// As above for a map: a file, or the files of a folder.
std::string state_of_map(const std::filesystem::path& map);

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
