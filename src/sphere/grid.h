// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cpu/row_kernels.h"

namespace pmsp {

/// Longest SIMD batch; tables and rows are padded by as much, so that the last batch of a row may read past its end.
constexpr int kMaxLanes = 16;

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

  /// Columns 0, 2, 4, ... (parity 0) or 1, 3, 5, ... (parity 1), padded.
  const float* sin_lon(int parity) const { return sin_lon_[parity].data(); }
  const float* cos_lon(int parity) const { return cos_lon_[parity].data(); }
  /// All columns in order, padded.
  const float* sin_lon() const { return sin_lon_[2].data(); }
  const float* cos_lon() const { return cos_lon_[2].data(); }
  const float* sin_lat() const { return sin_lat_.data(); }
  const float* cos_lat() const { return cos_lat_.data(); }

  cpu::GridTables tables() const {
    return {width_,    height_,  {sin_lon(0), sin_lon(1), sin_lon()}, {cos_lon(0), cos_lon(1), cos_lon()},
            sin_lat(), cos_lat()};
  }

 private:
  int width_;
  int height_;
  std::vector<float> sin_lon_[3];
  std::vector<float> cos_lon_[3];
  std::vector<float> sin_lat_;
  std::vector<float> cos_lat_;
};

}  // namespace pmsp
