// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cctype>
#include <cstdarg>
#include <cstdio>
#include <string>

namespace pmsp {

/// Converts to lower case (ASCII).
inline std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

inline bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Removes the given characters at both ends.
inline std::string trimmed(const std::string& text, const char* characters) {
  const std::size_t begin = text.find_first_not_of(characters);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(characters) + 1 - begin);
}

/// As std::printf; at most 500 bytes.
[[gnu::format(printf, 1, 2)]] inline std::string format(const char* pattern, ...) {
  char text[501];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof(text), pattern, arguments);
  va_end(arguments);
  return text;
}

/// Formats a number as std::printf.
inline std::string number_text(double value, const char* pattern = "%g") { return format(pattern, value); }

/// Returns "1920 x 960".
inline std::string size_text(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

}  // namespace pmsp
