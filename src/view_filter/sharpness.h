// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// Of some hundred of the keyframe's landmarks in pixels of a depth map of that width, ascending id; without those near
/// the poles and on patches without contrast. `executor`: nullptr = on this thread.
std::vector<LandmarkSharpness> landmark_sharpness(const Keyframe& keyframe, int width,
                                                  const Executor* executor = nullptr);

/// Median ratio of the sharpness of the same landmarks in two images, of the direction in which it is lower, or 1 where
/// too few are in common. Two sharp images of one place have about 1, whatever is to be seen there.
double relative_sharpness(const std::vector<LandmarkSharpness>& image, const std::vector<LandmarkSharpness>& other);

}  // namespace pmsp
