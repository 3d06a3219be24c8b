// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/camera.h"

#include <cmath>

#include "equirect.h"

namespace pmsp {

Eigen::Vector3d bearing_from_pixel(const Eigen::Vector2d& pixel, int width, int height) {
  const double lon = (pixel.x() / width - 0.5) * 2.0 * kernels::kPi;
  const double lat = (0.5 - pixel.y() / height) * kernels::kPi;
  const kernels::Vec3<double> b = kernels::bearing(std::sin(lon), std::cos(lon), std::sin(lat), std::cos(lat));
  return {b.x, b.y, b.z};
}

Eigen::Vector2d pixel_from_bearing(const Eigen::Vector3d& direction, int width, int height) {
  const kernels::Pixel<double> at =
      kernels::project_exactly({direction.x(), direction.y(), direction.z()}, width, height);
  return {at.x, at.y};
}

RigidTransform cam_from_slam_cam(int image_width) {
  const double angle = kernels::kPi / image_width;
  RigidTransform turn;
  turn.rotation << std::cos(angle), 0.0, std::sin(angle), 0.0, 1.0, 0.0, -std::sin(angle), 0.0, std::cos(angle);
  return turn;
}

}  // namespace pmsp
