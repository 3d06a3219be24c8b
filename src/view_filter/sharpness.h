// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "pmsp/keyframe.h"

namespace pmsp {

/// How sharply an image shows the surroundings of a landmark: squared differences of neighbouring pixels over the
/// variance of the patch, so that brightness and contrast do not matter. Blur lowers it.
struct LandmarkSharpness {
  std::int64_t id;
  float horizontal, vertical;
};

/// Of some hundred of the keyframe's landmarks in pixels of a depth map of that width, ascending id; without those near
/// the poles and on patches without contrast.
std::vector<LandmarkSharpness> landmark_sharpness(const Keyframe& keyframe, int width);

/// Median ratio of the sharpness of the same landmarks in two images, of the direction in which it is lower, or 1 where
/// too few are in common. Two sharp images of one place have about 1, whatever is to be seen there.
double relative_sharpness(const std::vector<LandmarkSharpness>& image, const std::vector<LandmarkSharpness>& other);

}  // namespace pmsp
