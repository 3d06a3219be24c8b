// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>

namespace pmsp::tool {

/// "depth_000012.pfm" of "depth_", 12 and ".pfm".
std::string numbered_name(const char* prefix, std::int64_t id, const char* extension);

/// Whether `name` is one that numbered_name() gives.
bool is_numbered_name(const std::string& name, const std::string& prefix, const std::string& extension);

}  // namespace pmsp::tool
