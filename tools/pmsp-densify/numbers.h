// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "exit_code.h"
#include "util/number_from.h"
#include "util/text.h"

namespace pmsp::tool {

/// Parses a number of an option, `low` to `high`. Throws UsageError with the expectation.
template <class T>
T number_in(const char* option, const std::string& text, T low, T high, const std::string& expected) {
  const auto value = number_from<T>(text);
  if (value && *value >= low && *value <= high) return *value;
  throw UsageError(std::string(option) + " is \"" + text + "\"; expected " + expected);
}

/// Parses a number > 0, up to 1e12. Throws UsageError.
inline double positive_from(const char* option, const std::string& text, const char* expected = "a number > 0") {
  return number_in(option, text, std::numeric_limits<double>::denorm_min(), 1e12, expected);
}

/// Parses a port of an option. Throws UsageError.
inline std::uint16_t port_from(const char* option, const std::string& text) {
  return static_cast<std::uint16_t>(number_in(option, text, 0, 65535, "a port, 1 to 65535, or 0 for one that is free"));
}

/// Parses N numbers separated by commas; nullopt if they are not N numbers.
template <std::size_t N>
std::optional<std::array<double, N>> numbers_from(const std::string& text) {
  std::array<double, N> numbers{};
  std::size_t at = 0;
  for (double& number : numbers) {
    if (at > text.size()) return std::nullopt;
    const std::size_t end = std::min(text.find(',', at), text.size());
    const auto value = number_from<double>(text.substr(at, end - at));
    if (!value) return std::nullopt;
    number = *value;
    at = end + 1;
  }
  return at > text.size() ? std::optional(numbers) : std::nullopt;
}

/// Returns the nearest-rank percentile, `percent` from 0 to 100; 0 if empty. Reorders `values`.
inline double percentile(std::vector<double>& values, double percent) {
  if (values.empty()) return 0.0;
  const auto last = static_cast<double>(values.size() - 1);
  const auto at = static_cast<std::ptrdiff_t>(std::lround(last * std::clamp(percent / 100.0, 0.0, 1.0)));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

/// Returns "12.5 %" for 0.125.
inline std::string percent_text(double share) { return number_text(100.0 * share, "%.1f %%"); }

}  // namespace pmsp::tool
