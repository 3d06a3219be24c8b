// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace pmsp {

/// Parses a number; nullopt unless the whole text is one. A leading + is allowed.
template <class T>
std::optional<T> number_from(std::string_view text) {
  T value{};
  const char* first = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const auto result = std::from_chars(first, text.data() + text.size(), value);
  const bool whole = result.ec == std::errc() && result.ptr == text.data() + text.size() && !text.empty();
  return whole ? std::optional<T>(value) : std::nullopt;
}

}  // namespace pmsp
