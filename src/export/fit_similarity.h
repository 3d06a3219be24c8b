// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

/// The rotation R that maximises trace(R^T m).
PMSP_API Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m);

/// Whether points lie on a line, or in one place: their second singular value is below 2 % of the first.
PMSP_API bool is_a_line(const std::vector<Eigen::Vector3d>& points);

/// Least-squares similarity from point pairs (Umeyama, "Least-squares estimation of transformation parameters between
/// two point patterns", 1991). Needs at least three pairs that do not lie on a line. Throws InvalidInput.
PMSP_API Similarity umeyama(const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& target);

/// Scale and translation that go best with a known rotation. Throws InvalidInput where all sources stand in one place,
/// or the targets lie the other way.
PMSP_API Similarity with_rotation(const Eigen::Matrix3d& rotation, const std::vector<Eigen::Vector3d>& source,
                                  const std::vector<Eigen::Vector3d>& target);

}  // namespace pmsp
