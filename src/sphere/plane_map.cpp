// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/plane_map.h"

#include "cpu/executor_impl.h"
#include "depth_image.h"
#include "plane.h"
#include "pmsp/error.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {

DepthMap depth_map_of(const PlaneMap& planes, const Image<float>* confidence, const Executor& executor) {
  const int width = planes.width();
  const int height = planes.height();
  if (confidence != nullptr && (confidence->width() != width || confidence->height() != height)) {
    throw InvalidInput("depth_map_of: planes and confidences differ in size");
  }
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "normals are written as numbers");
  const SphereGrid grid(width, height);
  DepthMap map{planes.keyframe_id, planes.cam_from_world, Image<float>(width, height),
               Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Zero()), Image<float>(width, height)};
  if (planes.empty()) return map;
  executor.impl().run(kernels::DepthImage<kernels::HostMachine>{
      view_of(planes), confidence == nullptr ? nullptr : confidence->pixels().data(), grid.view(),
      map.depth.pixels().data(), map.normal.pixels().data()->data(), map.confidence.pixels().data()});
  return map;
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
  const kernels::PlaneArrays to = arrays_of(planes);
  executor.impl().pool.for_each(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      if (!(map.depth(x, y) > 0.0F)) continue;
      const kernels::Place<float> at = kernels::place_of(x, y, width);
      const auto plane =
          kernels::plane_from(1.0F / map.depth(x, y), to_vec3(map.normal(x, y)), kernels::bearing_at(grid.view(), at));
      put(to, static_cast<std::size_t>(at.first), 1, kernels::Hypothesis<float>{plane, map.confidence(x, y)});
    }
  });
  return planes;
}

}  // namespace pmsp
