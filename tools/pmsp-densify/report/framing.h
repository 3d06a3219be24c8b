// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

namespace pmsp::tool {

/// A stretch of a line.
struct IdRange {
  double low = 0.0, high = 0.0;
};

/// The stretch that a picture of these values should show: from a percentile to another, as short as can be for the
/// share of the values in it. To leave out 1 % of them must shorten it by 8 %, 10 % of them by 57 %, 30 % by 94 %: a
/// crowd far away, such as what is seen through a window, does not make the room small, and the far end of a hall
/// stays. `values`: not empty.
IdRange busy_stretch(std::vector<double> values);

/// A box along the axes.
struct FramedBox {
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
};

/// The box that a picture of points should show: axis by axis as above, each time of the points within the other axes.
/// The path and what lies about it, as near as half of the points do, are always in it.
FramedBox busy_box(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& path);

}  // namespace pmsp::tool
