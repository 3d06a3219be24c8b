// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "pmsp/types.h"

namespace pmsp::tool {

/// Interval of coordinates.
struct Interval {
  double low = 0.0, high = 0.0;
};

/// Returns the interval that a picture of the values should show, between two percentiles: the optimum of length
/// against share of dropped values. Dropping 1 % must shorten it by 8 %, 10 % by 57 %, 30 % by 94 %: a distant cluster,
/// such as the view through a window, does not shrink the room, and the far end of a hall is kept. `values`: not empty.
Interval framing_interval(std::vector<double> values);

/// Axis-aligned box.
struct FramedBox {
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
};

/// Returns the box that a picture of points should show: framing_interval per axis, of the points inside the box on the
/// other axes. The path with its surroundings, within the median distance of the points, is always inside.
FramedBox framing_box(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& path);

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

/// Depth map as colour images.
struct DepthPicture {
  cv::Mat depth;          ///< BGR: inverse depth; black = none
  cv::Mat confidence;     ///< BGR: 0 violet to 1 yellow; black = none
  double near = 0.0;      ///< depth of the palette's high end (2nd percentile); 0 without depth
  double far = 0.0;       ///< depth of the palette's low end
  double coverage = 0.0;  ///< share of all pixels with a depth
  double mean_confidence = 0.0;
};

/// `palette`: one of OpenCV's colour maps, for depths.
DepthPicture draw_depth(const DepthMap& map, int palette);

/// Resizes an image to BGR of that size.
cv::Mat picture_of(ImageView<const Rgb> image, cv::Size size);
/// The same, at most `width` wide.
cv::Mat picture_of(ImageView<const Rgb> image, int width);

}  // namespace pmsp::tool
