// SPDX-License-Identifier: BSD-2-Clause
#include "numbered_name.h"

#include <algorithm>
#include <cstdio>

namespace pmsp::tool {

std::string numbered_name(const char* prefix, std::int64_t id, const char* extension) {
  char number[32];
  std::snprintf(number, sizeof(number), "%06lld", static_cast<long long>(id));
  return std::string(prefix) + number + extension;
}

bool is_numbered_name(const std::string& name, const std::string& prefix, const std::string& extension) {
  if (name.size() < prefix.size() + 6 + extension.size()) return false;
  const auto digits_end = name.end() - static_cast<std::ptrdiff_t>(extension.size());
  return name.compare(0, prefix.size(), prefix) == 0 && std::equal(extension.begin(), extension.end(), digits_end) &&
         std::all_of(name.begin() + static_cast<std::ptrdiff_t>(prefix.size()), digits_end,
                     [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace pmsp::tool
