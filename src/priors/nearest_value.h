// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "pmsp/camera.h"
#include "pmsp/types.h"

namespace pmsp {

/// Value of a depth image's nearest pixel in a direction [camera frame].
inline double nearest_value(ImageView<const float> image, const Eigen::Vector3d& direction) {
  const Eigen::Vector2d at = pixel_from_bearing(direction, image.width, image.height);
  const int x = (static_cast<int>(std::floor(at.x())) % image.width + image.width) % image.width;
  const int y = std::clamp(static_cast<int>(std::floor(at.y())), 0, image.height - 1);
  return static_cast<double>(image(x, y));
}

}  // namespace pmsp
