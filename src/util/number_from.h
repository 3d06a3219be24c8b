// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace pmsp {

/// Parses a number; nullopt unless the whole text is one.
template <class T>
std::optional<T> plain_number_from(std::string_view text) {
  T value{};
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = result.ec == std::errc() && result.ptr == text.data() + text.size();
  return whole ? std::optional<T>(value) : std::nullopt;
}

/// Parses a number; a leading + is allowed.
template <class T>
std::optional<T> number_from(std::string_view text) {
  if (text.size() > 1 && text.front() == '+') text.remove_prefix(1);
  return plain_number_from<T>(text);
}

}  // namespace pmsp
