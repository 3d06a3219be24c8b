// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cctype>
#include <string>

namespace pmsp {

/// Converts to lower case (ASCII).
inline std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace pmsp
