// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "grid_view.h"

namespace pmsp {

/// Owns the sines and cosines of an equirectangular image's columns and rows.
class SphereGrid {
 public:
  SphereGrid(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t size() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }

  /// Valid during the lifetime of the grid.
  kernels::GridView view() const {
    return {width_, height_, sin_lon_.data(), cos_lon_.data(), sin_lat_.data(), cos_lat_.data()};
  }

 private:
  int width_;
  int height_;
  std::vector<float> sin_lon_, cos_lon_, sin_lat_, cos_lat_;
};

}  // namespace pmsp
