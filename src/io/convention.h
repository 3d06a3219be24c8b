// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>

#include "pmsp/api.h"
#include "pmsp/io/map.h"

namespace pmsp {

/// Reprojection error of a map's observations, compared with other conventions.
struct ConventionCheck {
  std::size_t observations = 0;  ///< number of observations tested: all, or some of all keyframes
  double median_error_px = 0.0;  ///< between projection and observation [px of the images]
  std::string fits_better;       ///< description of another convention that fits clearly better; "" = none
  double better_error_px = 0.0;  ///< its median error [px]
  std::string remark;            ///< harmless deviation; "" = none
};

/// Tests the conventions of a map against others with the same numbers: mirrored images, flipped latitude, OpenGL or
/// body axes, seam in front, inverted poses, quaternions with w first, pixels off by half. No verdict with fewer than
/// 100 observations or if these are projections themselves (`SlamMap::observations_are_measured`); then `observations`
/// is 0.
PMSP_API ConventionCheck check_convention(const SlamMap& map);

/// As check_convention; throws InvalidInput, naming the convention that fits better, if there is one.
PMSP_API ConventionCheck require_convention(const SlamMap& map);

}  // namespace pmsp
