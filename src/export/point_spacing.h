// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "util/thread_pool.h"

namespace pmsp {

/// Returns, for each point of a surface, the spacing of the points around it: the square root of the area per point,
/// from the distance of the 8th nearest. At most twice the median of these, and four times the 99th percentile of all,
/// so that stray points are not large; 0 for a single point and coincident ones.
std::vector<float> point_spacing(const std::vector<Eigen::Vector3f>& positions, ThreadPool& pool);

}  // namespace pmsp
