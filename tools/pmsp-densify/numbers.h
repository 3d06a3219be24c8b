// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <string>

#include "exit_code.h"
#include "util/number_from.h"

namespace pmsp::tool {

/// Parses a number of an option, `low` to `high`. Throws UsageError with the expectation.
template <class T>
T number_in(const char* option, const std::string& text, T low, T high, const std::string& expected) {
  const auto value = number_from<T>(text);
  if (value && *value >= low && *value <= high) return *value;
  throw UsageError(std::string(option) + " is \"" + text + "\"; expected " + expected);
}

}  // namespace pmsp::tool
