// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "stage.h"

namespace pmsp::kernels {

/// Planes of a map for the user (pmsp::PlaneMap); a stage.
template <class ViewTypes>
struct PlaneImage {
  static constexpr int kCounts = 0;

  typename ViewTypes::Map map;
  GridView grid;
  float* x;
  float* y;
  float* z;
  float* score;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const Vec3<float> plane = plane_at<float>(map, at.index);
    x[at.index] = plane.x;
    y[at.index] = plane.y;
    z[at.index] = plane.z;
    score[at.index] = score_at<float>(map, at.index);
  }
};

}  // namespace pmsp::kernels
