// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace pmsp::tool {

/// "depth_000012.pfm" of "depth_", 12 and ".pfm".
std::string numbered_name(const char* prefix, std::int64_t id, const char* extension);

/// Whether `name` is one that numbered_name() gives.
bool is_numbered_name(const std::string& name, const std::string& prefix, const std::string& extension);

/// Makes a folder, and removes from it the files that an earlier run wrote, as `is_own` knows them by their names: they
/// would be taken for this run's. Throws OutputError.
void prepare_folder(const std::filesystem::path& folder, bool (*is_own)(const std::string& name));

}  // namespace pmsp::tool
