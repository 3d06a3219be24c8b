// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

namespace pmsp::tool {

/// Returns time and size of a file as a line, or that it is missing.
std::string state_of(const std::filesystem::path& file);

/// Returns names and states of all files in a folder, sorted.
std::string state_of_files_in(const std::filesystem::path& folder);

/// As above for a map: a file, or the files of a folder.
std::string state_of_map(const std::filesystem::path& map);

}  // namespace pmsp::tool
