// SPDX-License-Identifier: BSD-2-Clause
#include <limits>

#include "cpu/executor_impl.h"
#include "equirect.h"
#include "plane.h"
#include "pmsp/initialiser.h"
#include "sphere/grid.h"
#include "util/eigen_kernels.h"

namespace pmsp {

PlaneImage warp_planes(const DepthMap& previous, const RigidTransform& cam_from_world, int width, int height,
                       const Executor& executor) {
  using kernels::Vec3;
  const SphereGrid grid(previous.depth.width(), previous.depth.height());
  const RigidTransform cam_from_previous = cam_from_world * previous.cam_from_world.inverse();
  const kernels::Rigid forward = to_rigid(cam_from_previous);
  const kernels::Rigid backward = to_rigid(cam_from_previous.inverse());
  const auto surface_point = [&](int x, int y) {
    return previous.depth(x, y) *
           kernels::bearing(grid.sin_lon()[x], grid.cos_lon()[x], grid.sin_lat()[y], grid.cos_lat()[y]);
  };

  // Where each pixel goes: independent of each other, on all threads.
  Image<std::int32_t> target(grid.width(), grid.height(), -1);
  Image<float> range(grid.width(), grid.height(), 0.0F);
  executor.impl().pool.for_each(grid.height(), [&](int y) {
    for (int x = 0; x < grid.width(); ++x) {
      if (previous.depth(x, y) <= 0.0F) continue;
      const Vec3<float> p = kernels::transform(forward, surface_point(x, y));
      target(x, y) = kernels::pixel_index(p, width, height);
      range(x, y) = std::sqrt(kernels::dot(p, p));
    }
  });

  // Who is in front: in one thread, since several pixels meet in one.
  PlaneImage planes(width, height, Eigen::Vector3f::Zero());
  std::vector<float> front(planes.size(), std::numeric_limits<float>::max());
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      const std::int32_t to = target(x, y);
      if (to < 0 || range(x, y) >= front[static_cast<std::size_t>(to)]) continue;
      front[static_cast<std::size_t>(to)] = range(x, y);
      const Vec3<float> normal = to_vec3(previous.normal(x, y));
      const Vec3<float> plane = (1.0F / kernels::dot(normal, surface_point(x, y))) * normal;
      planes.pixels()[static_cast<std::size_t>(to)] = to_eigen(kernels::moved_plane(plane, backward));
    }
  }
  return planes;
}

}  // namespace pmsp
