// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

#include "equirect.h"

namespace pmsp::kernels {

/// Sines and cosines of an equirectangular image's columns and rows.
struct GridView {
  int width, height;
  const float* sin_lon;
  const float* cos_lon;
  const float* sin_lat;
  const float* cos_lat;
};
template <class F>
PMSP_HD Vec3<F> bearing_at(const GridView& grid, const IntOf<F>& column, const IntOf<F>& row) {
  return bearing(gather<F>(grid.sin_lon, column), gather<F>(grid.cos_lon, column), gather<F>(grid.sin_lat, row),
                 gather<F>(grid.cos_lat, row));
}

/// Checkerboard order: each row stores its pixels of colour 0, then those of colour 1; colour = (x + y) mod 2. The
/// pixels of one colour in a row are a ring, since columns wrap around. Pixel k of a ring is x = 2 k + (y + colour)
/// mod 2. ring_index: index of a ring's first pixel.
PMSP_HD std::size_t ring_index(int width, int y, int colour) {
  return (static_cast<std::size_t>(y) * 2 + static_cast<std::size_t>(colour)) * static_cast<std::size_t>(width / 2);
}
PMSP_HD std::size_t checkerboard_index(int width, int x, int y) {
  return ring_index(width, y, (x + y) & 1) + static_cast<std::size_t>(x / 2);
}

/// Column and row of the pixel at offset (dx, dy); beyond a pole the image continues on the opposite meridian. |dx| <
/// width, |dy| < height.
template <class F>
struct WrappedPixel {
  IntOf<F> column, row;
};
template <class F>
PMSP_HD WrappedPixel<F> wrapped_pixel(const GridView& grid, const IntOf<F>& column, int row, int dx, int dy) {
  const int y = row + dy;
  const bool beyond = y < 0 || y >= grid.height;
  const int there = y < 0 ? -1 - y : beyond ? 2 * grid.height - 1 - y : y;
  const F width(static_cast<float>(grid.width));
  const F x = from_int<F>(column) + F(static_cast<float>(dx + grid.width + (beyond ? grid.width / 2 : 0)));
  const F once = select(x >= width, x - width, x);
  return {to_int(select(once >= width, once - width, once)), IntOf<F>(there)};
}

}  // namespace pmsp::kernels
