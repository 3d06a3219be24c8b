// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstring>
#include <string>
#include <type_traits>

namespace pmsp {

/// Stores a number little-endian; returns the position after it.
template <class T>
char* put_little(char* at, T value) {
  static_assert(std::is_arithmetic_v<T>, "numbers only");
  std::memcpy(at, &value, sizeof(T));
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  std::reverse(at, at + sizeof(T));
#endif
  return at + sizeof(T);
}

/// Appends it to a string.
template <class T>
void append_little(std::string& text, T value) {
  char bytes[sizeof(T)];
  put_little(bytes, value);
  text.append(bytes, sizeof(T));
}

/// Returns the number stored at `at` with the given byte order.
template <class T>
T get_number(const char* at, bool big_endian) {
  static_assert(std::is_arithmetic_v<T>, "numbers only");
  char bytes[sizeof(T)];
  std::memcpy(bytes, at, sizeof(T));
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  big_endian = !big_endian;
#endif
  if (big_endian) std::reverse(bytes, bytes + sizeof(T));
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// Returns the number that put_little stored at `at`.
template <class T>
T get_little(const char* at) {
  return get_number<T>(at, false);
}

template <class T>
T get_big(const char* at) {
  return get_number<T>(at, true);
}

}  // namespace pmsp
