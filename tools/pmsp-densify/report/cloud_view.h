// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "pmsp/types.h"

namespace pmsp::tool {

/// A point as far as pictures need it, world frame.
struct ViewPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  Eigen::Matrix<std::int8_t, 3, 1> normal = Eigen::Matrix<std::int8_t, 3, 1>::Zero();  ///< times 127
  Rgb color;
};

/// What is drawn: points, the camera's path, and which way is up.
struct ViewScene {
  std::vector<ViewPoint> points;
  std::vector<Eigen::Vector3d> path;
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  double spacing = 0.0;  ///< that the points were thinned to [scene units]; 0 = not thinned
  std::string caption;
};

/// What the pictures leave out so that the building fills them: "3.1 % of the points lie outside, up to 212 scene units
/// away"; "" where that is next to nothing. What is cut off above the camera is not counted.
std::string left_out_of(const ViewScene& scene);

/// The scene straight from above, cut off a little above the camera's path: ceilings would hide the rooms. The longer
/// side of the building lies along the picture, the start of the path on its left.
cv::Mat draw_from_above(const ViewScene& scene);

/// The scene in perspective from outside one of its upper corners. Surfaces seen from behind are left out, which opens
/// the near walls and the ceiling.
cv::Mat draw_from_corner(const ViewScene& scene);

}  // namespace pmsp::tool
