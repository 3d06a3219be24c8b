// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>

#include "pmsp/api.h"
#include "pmsp/io/map.h"

namespace pmsp {

/// How well the landmarks of a map project to where its keyframes observe them.
struct ConventionCheck {
  std::size_t observations = 0;  ///< looked at: all, or some of all keyframes
  double median_error_px = 0.0;  ///< from the projection to the observation, in the images [px]
  std::string fits_better;       ///< another convention that clearly fits better, in words; "" = none does
  double better_error_px = 0.0;  ///< its median error [px]
  std::string remark;            ///< what does no harm but should be known; "" = nothing
};

/// Proof of the conventions that a map was read by: compares them with other conventions for the same numbers, such as
/// mirrored images, latitude upside down, axes of OpenGL or of a body, the seam in front, inverted poses, quaternions
/// with w first, and places in images that are half a pixel off. Decides nothing with less than 100 observations, nor
/// where these are projections themselves (`SlamMap::observations_are_tested`); then `observations` is 0.
PMSP_API ConventionCheck check_convention(const SlamMap& map);

/// The same, for a program that cannot go on with a wrong one: throws InvalidInput that names the convention that fits.
PMSP_API ConventionCheck require_convention(const SlamMap& map);

}  // namespace pmsp
