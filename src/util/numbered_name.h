// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>

#include "util/text.h"

namespace pmsp {

/// Returns "depth_000012.pfm" for "depth_", 12 and ".pfm".
inline std::string numbered_name(const std::string& prefix, std::int64_t id, const std::string& extension) {
  return prefix + format("%06lld", static_cast<long long>(id)) + extension;
}

/// Returns the digits between prefix and extension; "" for other names.
inline std::string digits_in_name(const std::string& name, const std::string& prefix, const std::string& extension) {
  if (name.size() < prefix.size() + extension.size()) return "";
  const std::string digits = name.substr(prefix.size(), name.size() - prefix.size() - extension.size());
  const bool is_number = digits.find_first_not_of("0123456789") == std::string::npos;
  return is_number && name == prefix + digits + extension ? digits : "";
}

/// True for names of numbered_name().
inline bool is_numbered_name(const std::string& name, const std::string& prefix, const std::string& extension) {
  return digits_in_name(name, prefix, extension).size() >= 6;
}

}  // namespace pmsp
