// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <charconv>
#include <optional>
#include <string>
#include <system_error>

#include "exit_code.h"

namespace pmsp::tool {

/// The number that the whole of `text` is, nullopt otherwise. A leading + is fine.
template <class T>
std::optional<T> number_from(const std::string& text) {
  T value{};
  const char* first = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const auto result = std::from_chars(first, text.data() + text.size(), value);
  const bool whole = result.ec == std::errc() && result.ptr == text.data() + text.size() && !text.empty();
  return whole ? std::optional<T>(value) : std::nullopt;
}

/// A number of an option, from `low` to `high`. Throws UsageError, which says what was expected.
template <class T>
T number_in(const char* option, const std::string& text, T low, T high, const std::string& expected) {
  const auto value = number_from<T>(text);
  if (value && *value >= low && *value <= high) return *value;
  throw UsageError(std::string(option) + " is \"" + text + "\"; expected " + expected);
}

}  // namespace pmsp::tool
