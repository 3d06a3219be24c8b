// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "grid_view.h"

namespace pmsp {

/// Sines and cosines of an equirectangular image's columns and rows, and the checkerboard order in which PatchMatch
/// keeps its pixels: each row's pixels of colour 0, then those of colour 1, where colour = (x + y) mod 2. The k-th
/// pixel of colour c in row y is x = 2 k + (y + c) mod 2.
class SphereGrid {
 public:
  SphereGrid(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  int half() const { return width_ / 2; }

  static int first_column(int y, int colour) { return (y + colour) & 1; }
  /// Index of the k-th pixel of a colour in a row.
  std::size_t index(int y, int colour, int k) const {
    return (static_cast<std::size_t>(y) * 2 + static_cast<std::size_t>(colour)) * static_cast<std::size_t>(half()) +
           static_cast<std::size_t>(k);
  }
  /// Index of pixel (x, y).
  std::size_t index(int x, int y) const { return index(y, (x + y) & 1, x / 2); }
  std::size_t size() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }

  /// Valid as long as the grid.
  kernels::GridView view() const {
    return {width_, height_, sin_lon_.data(), cos_lon_.data(), sin_lat_.data(), cos_lat_.data()};
  }

 private:
  int width_;
  int height_;
  std::vector<float> sin_lon_, cos_lon_, sin_lat_, cos_lat_;
};

}  // namespace pmsp
