// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/stages.h"

#include "cpu/cpu_processor.h"
#include "plane.h"
#include "pmsp/error.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {

DepthMap depth_map_of(const PlaneMap& planes, const Image<float>* confidence, const Executor& executor) {
  const int width = planes.width();
  const int height = planes.height();
  if (confidence != nullptr && (confidence->width() != width || confidence->height() != height)) {
    throw InvalidInput("depth_map_of: planes and confidences differ in size");
  }
  if (planes.empty()) return {planes.keyframe_id, planes.cam_from_world, {}, {}, {}, planes.scale};
  return CpuProcessor(executor, width, height)
      .depth_map(planes.keyframe_id, planes.pose(), view_of(planes),
                 confidence == nullptr ? nullptr : confidence->pixels().data());
}

PlaneMap plane_map_of(const DepthMap& map, const Executor& executor) {
  const int width = map.depth.width();
  const int height = map.depth.height();
  if (map.normal.width() != width || map.normal.height() != height || map.confidence.width() != width ||
      map.confidence.height() != height) {
    throw InvalidInput("plane_map_of: depths, normals and confidences differ in size");
  }
  const SphereGrid grid(width, height);
  PlaneMap planes(width, height);
  planes.keyframe_id = map.keyframe_id;
  planes.cam_from_world = map.cam_from_world;
  planes.scale = map.scale;
  const kernels::PlaneArrays to = arrays_of(planes);
  pool_of(executor).for_each(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      if (!(map.depth(x, y) > 0.0F)) continue;
      const kernels::RowPixels<float> at = kernels::single_pixel(x, y, width);
      const auto plane =
          kernels::plane_from(1.0F / map.depth(x, y), to_vec3(map.normal(x, y)), kernels::bearing_at(grid.view(), at));
      put(to, static_cast<std::size_t>(at.first), 1, kernels::Hypothesis<float>{plane, map.confidence(x, y)});
    }
  });
  return planes;
}

}  // namespace pmsp
