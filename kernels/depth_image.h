// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "stage.h"

namespace pmsp::kernels {

/// Depths, normals and confidences of a plane map for the user (pmsp::DepthMap); a stage.
template <class ViewTypes>
struct DepthImage {
  static constexpr int kCounts = 0;

  typename ViewTypes::Map map;
  const float* filtered_confidence;  ///< confidence of each pixel, 0 = no depth; nullptr = the score, clamped to 0 to 1
  GridView grid;
  float* depth;
  float* normal;  ///< three per pixel
  float* confidence;

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  PMSP_HD void operator()(const RowPixels<float>& at, bool* /*counted*/) const {
    const Vec3<float> plane = plane_at<float>(map, at.index);
    const Surface<float> surface = surface_of(plane, bearing_at(grid, at));
    const bool known = surface.known && surface.depth < 1.0F / kFarLimit &&
                       (filtered_confidence == nullptr || filtered_confidence[at.index] > 0.0F);
    const Vec3<float> facing = known ? -1.0F * normalized(plane) : Vec3<float>{0.0F, 0.0F, 0.0F};
    const float own = filtered_confidence != nullptr ? filtered_confidence[at.index]
                                                     : min(max(score_at<float>(map, at.index), 0.0F), 1.0F);
    depth[at.index] = known ? surface.depth : 0.0F;
    normal[3 * at.index] = facing.x;
    normal[3 * at.index + 1] = facing.y;
    normal[3 * at.index + 2] = facing.z;
    confidence[at.index] = known ? own : 0.0F;
  }
};

}  // namespace pmsp::kernels
