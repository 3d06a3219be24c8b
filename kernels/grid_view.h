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
template <class F>
PMSP_HD Vec3<F> bearing_at(const GridView& grid, const IntOf<F>& column, const IntOf<F>& row) {
  return bearing(gather<F>(grid.sin_lon, column), gather<F>(grid.cos_lon, column), gather<F>(grid.sin_lat, row),
                 gather<F>(grid.cos_lat, row));
}

}  // namespace pmsp::kernels
