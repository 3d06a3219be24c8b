// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// Returns the sharpness at up to 256 landmarks, in pixels of a depth map of `width`, by ascending id; without those
/// near the poles and in patches without contrast. `executor`: nullptr = this thread.
std::vector<LandmarkSharpness> landmark_sharpness(const Keyframe& keyframe, int width,
                                                  const Executor* executor = nullptr);

/// Returns the median ratio of the sharpness of common landmarks in two images, in the direction where it is lower; 1
/// if too few are common. About 1 for two sharp images of one place, whatever their content.
double relative_sharpness(const std::vector<LandmarkSharpness>& image, const std::vector<LandmarkSharpness>& other);

}  // namespace pmsp
