// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>

namespace pmsp::io {

/// True for full panoramas: twice as wide as high, within one row.
inline bool is_panorama_size(std::int64_t width, std::int64_t height) {
  return width > 0 && height > 0 && width - 2 * height >= -2 && width - 2 * height <= 2;
}

/// Returns the even height, half the width, to which such a panorama is resized; that of the image if valid.
inline int panorama_height(int width, int height) {
  const int nearest = width != 2 * height && width / 2 % 2 == 0 ? width / 2 : height;
  return std::max(2, nearest / 2 * 2);
}

}  // namespace pmsp::io
