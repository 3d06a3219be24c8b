// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "agreement.h"
#include "fusion.h"
#include "grid_view.h"

// The point of one pixel: the average over the maps of its window that agree, the same whichever keyframe's turn it is.
namespace pmsp::kernels {

/// A map of the window: its surfaces after the consistency filter.
struct FusionView {
  PlaneMapView planes;
  const float* confidence;
  const std::uint8_t* color;  ///< red, green, blue of each pixel
  Rigid other_from_first;     ///< from the first keyframe's unit of length into the other's: the rotation times `zoom`
  float zoom;                 ///< the first keyframe's scale over the other's
};

struct FusionLimits {
  float max_relative_depth;
  float min_cos_normals;
};

struct FusedPoint {
  float depth;         ///< along the pixel's bearing
  Vec3<float> normal;  ///< unit, camera frame
  Vec3<float> color;
  int views;            ///< maps that agree, the pixel's own included
  std::uint32_t agree;  ///< bit k: others[k] does
};

PMSP_HD Vec3<float> color_at(const std::uint8_t* color, std::int32_t index) {
  const std::uint8_t* const rgb = color + 3 * static_cast<std::int64_t>(index);
  return {static_cast<float>(rgb[0]), static_cast<float>(rgb[1]), static_cast<float>(rgb[2])};
}

/// `index`: of a pixel that has a plane; `bearing`: its own. `others`: `count` of them, 32 at most.
PMSP_HD FusedPoint fused_point(const FusionView& first, std::int32_t index, const Vec3<float>& bearing,
                               const FusionView* others, int count, const FusionLimits& limits) {
  const Vec3<float> plane = plane_at<float>(first.planes, index);
  const float depth = 1.0F / dot(plane, bearing);
  const Vec3<float> normal = -1.0F * normalized(plane);
  FusionSums sums;
  sums.add(fusion_weight(first.confidence[index], depth), depth, normal, color_at(first.color, index));
  std::uint32_t agree = 0;
  for (int k = 0; k < count; ++k) {
    const FusionView& other = others[k];
    const Agreement<float> seen = agreement(bearing, depth, other.planes, other.other_from_first);
    if (abs(seen.closeness - 1.0F) > limits.max_relative_depth) continue;
    const Vec3<float> there = -1.0F * normalized(plane_at<float>(other.planes, seen.index));
    const Vec3<float> turned = (1.0F / other.zoom) * rotate_back(other.other_from_first, there);
    if (dot(turned, normal) < limits.min_cos_normals) continue;
    const Vec3<float> p = transform(other.other_from_first, depth * bearing);
    const float other_depth = sqrt(dot(p, p)) / (other.zoom * seen.closeness);  // in the first one's unit
    sums.add(fusion_weight(other.confidence[seen.index], other_depth), seen.implied_depth, turned,
             color_at(other.color, seen.index));
    agree |= 1U << static_cast<unsigned>(k);
  }
  return {sums.depth / sums.weight, normalized(sums.normal), (1.0F / sums.weight) * sums.color, sums.views, agree};
}

/// Where the points of a keyframe go, one array each, in row order.
struct FusedArrays {
  float* depth;         ///< 0 = no point
  float* normal;        ///< x, y, z of each pixel
  float* confidence;    ///< of the pixel's own map
  std::uint8_t* color;  ///< red, green, blue of each pixel
  std::uint8_t* views;  ///< at most 255
  std::uint32_t* agree;
};

/// Makes the point of a pixel; a stage.
struct FusePixel {
  FusionView first;
  GridView grid;
  const FusionView* others;
  int count;
  FusionLimits limits;
  float min_confidence;
  FusedArrays to;  ///< all 0 before

  PMSP_HD void operator()(int column, int row) const {
    const int index = row * first.planes.width + column;
    const Vec3<float> bearing = bearing_at(grid, column, row);
    const float confidence = first.confidence[index];
    if (!(dot(plane_at<float>(first.planes, index), bearing) > 0.0F) || confidence < min_confidence) return;
    const FusedPoint point = fused_point(first, index, bearing, others, count, limits);
    to.depth[index] = point.depth;
    to.normal[3 * index] = point.normal.x;
    to.normal[3 * index + 1] = point.normal.y;
    to.normal[3 * index + 2] = point.normal.z;
    to.confidence[index] = confidence;
    to.color[3 * index] = static_cast<std::uint8_t>(point.color.x + 0.5F);
    to.color[3 * index + 1] = static_cast<std::uint8_t>(point.color.y + 0.5F);
    to.color[3 * index + 2] = static_cast<std::uint8_t>(point.color.z + 0.5F);
    to.views[index] = static_cast<std::uint8_t>(point.views);
    to.agree[index] = point.agree;
  }
};

}  // namespace pmsp::kernels
