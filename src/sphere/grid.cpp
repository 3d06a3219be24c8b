// SPDX-License-Identifier: BSD-2-Clause
#include "sphere/grid.h"

#include <cmath>

#include "elementary.h"

namespace pmsp {

SphereGrid::SphereGrid(int width, int height) : width_(width), height_(height) {
  for (int x = 0; x < width; ++x) {
    const double lon = ((x + 0.5) / width - 0.5) * 2.0 * kernels::kPi;
    sin_lon_.push_back(static_cast<float>(std::sin(lon)));
    cos_lon_.push_back(static_cast<float>(std::cos(lon)));
  }
  for (int y = 0; y < height; ++y) {
    const double lat = (0.5 - (y + 0.5) / height) * kernels::kPi;
    sin_lat_.push_back(static_cast<float>(std::sin(lat)));
    cos_lat_.push_back(static_cast<float>(std::cos(lat)));
  }
}

}  // namespace pmsp
