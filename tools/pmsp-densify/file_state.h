// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

namespace pmsp::tool {

/// A line: time and size, or that there is no such file.
std::string state_of(const std::filesystem::path& file);

/// Names and states of all files in a folder, in order.
std::string state_of_files_in(const std::filesystem::path& folder);

/// The same of a map: a file, or a folder with its files.
std::string state_of_map(const std::filesystem::path& map);

}  // namespace pmsp::tool
