// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>

namespace pmsp::tool {

/// Returns "depth_000012.pfm" for "depth_", 12 and ".pfm".
std::string numbered_name(const char* prefix, std::int64_t id, const char* extension);

/// True for names of numbered_name().
bool is_numbered_name(const std::string& name, const std::string& prefix, const std::string& extension);

}  // namespace pmsp::tool
