// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmsp/image.h"
#include "pmsp/keyframe.h"
#include "pmsp/options.h"

namespace pmsp {

/// Throws InvalidInput, naming keyframe and field, unless image, mask, pose, scale and landmarks are usable.
void check_keyframe(const Keyframe& keyframe);

/// Throw InvalidInput unless usable. `where`: the first words of the text.
void check_sizes(const std::string& where, int image_width, int image_height, ImageView<const std::uint8_t> mask);
void check_scale(const std::string& where, double scale);
void check_pose(const std::string& where, const RigidTransform& cam_from_world);
void check_landmarks(const std::string& where, const std::vector<Landmark>& landmarks);

/// Replaces a width or height of 0 by what an image of this size stands for. Throws InvalidInput if that is no size of
/// a depth map.
void fill_in_size(DensifierOptions& options, int image_width, int image_height);

}  // namespace pmsp
