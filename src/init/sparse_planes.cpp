// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include "equirect.h"
#include "pmsp/camera.h"
#include "pmsp/initialiser.h"

namespace pmsp {

PlaneImage planes_from_landmarks(const Keyframe& keyframe, int width, int height, const InitOptions& options) {
  PlaneImage planes(width, height, Eigen::Vector3f::Zero());
  Image<float> nearest(width, height, std::numeric_limits<float>::max());  // squared distance [px]
  const double radius = options.sparse_radius_px;
  for (const Landmark& landmark : keyframe.landmarks) {
    const Eigen::Vector3d p = keyframe.cam_from_world * landmark.position_world;
    if (!is_usable_depth(p.norm())) continue;
    const Eigen::Vector2d at = pixel_from_bearing(p, width, height);
    const Eigen::Vector3f plane = (p / p.squaredNorm()).cast<float>();
    const int y0 = std::max(0, static_cast<int>(std::floor(at.y() - radius)));
    const int y1 = std::min(height - 1, static_cast<int>(std::floor(at.y() + radius)));
    for (int y = y0; y <= y1; ++y) {
      const double dy = y + 0.5 - at.y();
      const double narrowing = std::max(std::cos((0.5 - (y + 0.5) / height) * kernels::kPi), 1e-3);
      const double reach = std::min(radius / narrowing, 0.5 * width - 1.0);
      const int first = static_cast<int>(std::floor(at.x() - reach));
      const int last = static_cast<int>(std::floor(at.x() + reach));
      for (int column = first; column <= last; ++column) {
        const double dx = (column + 0.5 - at.x()) * narrowing;
        const float distance = static_cast<float>(dx * dx + dy * dy);
        const int x = (column + width) % width;
        if (distance > radius * radius || distance >= nearest(x, y)) continue;
        nearest(x, y) = distance;
        planes(x, y) = plane;
      }
    }
  }
  return planes;
}

}  // namespace pmsp
