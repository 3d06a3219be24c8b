// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pmsp::io {

/// Big-endian unsigned number; bytes beyond the end are skipped.
inline std::uint64_t big_endian(const std::vector<std::uint8_t>& bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = at; i < at + count && i < bytes.size(); ++i) value = value * 256 + bytes[i];
  return value;
}

/// Calls see(kind, at, size) for each segment of a JPEG before its scan, skipping by length, since embedded thumbnails
/// have markers of their own. `at`, `size`: payload, possibly beyond the end of a broken file. Returns the offset after
/// the last segment.
template <class See>
std::size_t each_jpeg_segment(const std::vector<std::uint8_t>& bytes, const See& see) {
  constexpr std::uint8_t kMark = 0xFF, kScan = 0xDA;
  std::size_t at = 2;
  while (at + 4 <= bytes.size() && bytes[at] == kMark && bytes[at + 1] != kScan) {
    if (bytes[at + 1] == kMark) {  // fill byte
      ++at;
      continue;
    }
    const auto length = static_cast<std::size_t>(big_endian(bytes, at + 2, 2));
    see(bytes[at + 1], at + 4, length < 2 ? 0 : length - 2);
    at += 2 + length;
  }
  return at;
}

}  // namespace pmsp::io
