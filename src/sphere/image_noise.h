// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/types.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Noise of the gray values of an equirectangular image: variance around a linear ramp in the least textured 5 % of
/// patches on the sphere [gray levels squared]. Patches have the size of those that measure texture in a depth map of
/// `width` (texture_spacing), averaged over its pixels; or in an image of `matched_width` (matching_size), if these
/// are noisier, since finer pixels average less of the camera's noise. Clipped and masked patches are ignored. Usually
/// below 0.6 in clean images; texture all over the image adds to it. 0 if there are too few patches.
float image_noise(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int matched_width,
                  ThreadPool& pool);

}  // namespace pmsp
