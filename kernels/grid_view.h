// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"

namespace pmsp::kernels {

/// Sines and cosines of an equirectangular image's columns and rows.
struct GridView {
  const float* sin_lon;
  const float* cos_lon;
  const float* sin_lat;
  const float* cos_lat;
};
PMSP_HD Vec3<float> bearing_at(const GridView& grid, int column, int row) {
  return bearing(grid.sin_lon[column], grid.cos_lon[column], grid.sin_lat[row], grid.cos_lat[row]);
}

}  // namespace pmsp::kernels
