// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "pmsp/types.h"

namespace pmsp::tool {

/// Point for drawing, in world frame.
struct ViewPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  Eigen::Matrix<std::int8_t, 3, 1> normal = Eigen::Matrix<std::int8_t, 3, 1>::Zero();  ///< unit normal * 127
  Rgb color;
};

/// Points, camera path and up direction.
struct ViewScene {
  std::vector<ViewPoint> points;
  std::vector<Eigen::Vector3d> path;
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  double spacing = 0.0;  ///< of thinned points [map units]; 0 = not thinned
  std::string caption;
};

/// Returns what is outside of the pictures' bounds: "3.1 % of the points lie outside, up to 212 map units away"; ""
/// if negligible. Points cut off above the camera are not counted.
std::string left_out_of(const ViewScene& scene);

/// Draws the scene from above, cut slightly above the camera's path, so that ceilings do not hide rooms. The building's
/// longer side is horizontal, the start of the path at the left.
cv::Mat draw_from_above(const ViewScene& scene);

/// Draws the scene in perspective from outside an upper corner, with back-face culling, which opens near walls and the
/// ceiling.
cv::Mat draw_from_corner(const ViewScene& scene);

}  // namespace pmsp::tool
