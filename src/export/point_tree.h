// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <nanoflann.hpp>

namespace pmsp {

/// Points as nanoflann reads them.
struct PointSet {
  const std::vector<Eigen::Vector3f>& points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::uint32_t index, std::size_t axis) const {
    return points[index][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using PointTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointSet, float, std::uint32_t>, PointSet,
                                        3, std::uint32_t>;

}  // namespace pmsp
