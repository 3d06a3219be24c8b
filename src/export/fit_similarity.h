// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

/// Returns the rotation R that maximises trace(R^T m).
PMSP_API Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m);

/// True for points on a line or in one place: their second singular value is below 2 % of the first.
PMSP_API bool is_a_line(const std::vector<Eigen::Vector3d>& points);

/// Returns the least-squares similarity of point pairs (Umeyama, "Least-squares estimation of transformation parameters
/// between two point patterns", 1991). Needs at least three pairs that are not on a line. Throws InvalidInput.
PMSP_API Similarity umeyama(const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& target);

/// Returns the least-squares scale and translation for a known rotation. Throws InvalidInput if all sources coincide or
/// the scale is not positive.
PMSP_API Similarity with_rotation(const Eigen::Matrix3d& rotation, const std::vector<Eigen::Vector3d>& source,
                                  const std::vector<Eigen::Vector3d>& target);

}  // namespace pmsp
