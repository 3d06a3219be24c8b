// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/options.h"
#include "pmsp/types.h"

namespace pmsp {

/// Throws InvalidInput, naming keyframe and field, if image, mask, pose, scale or landmarks are invalid.
void check_keyframe(const Keyframe& keyframe);

/// Throw InvalidInput if invalid. `where`: start of the message.
void check_sizes(const std::string& where, int image_width, int image_height, ImageView<const std::uint8_t> mask);
void check_prior_depth(const std::string& where, ImageView<const float> prior);
PMSP_API void check_scale(const std::string& where, double scale);
PMSP_API void check_pose(const std::string& where, const RigidTransform& cam_from_world);
void check_landmarks(const std::string& where, const std::vector<Landmark>& landmarks);
void check_pose_error(const std::string& where, double error);

}  // namespace pmsp
