// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

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

}  // namespace pmsp::tool
