// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/types.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Noise of the gray values of an equirectangular image: their variance, less that of a linear ramp, in the barest
/// twentieth of patches all over the sphere [gray levels squared]. Patches have the size by which texture
/// is judged in a depth map of `width` (texture_spacing), and are averaged over its pixels as the engine does; or those
/// of an image of `compared_width`, as images are compared (compared_size), where these have more: finer pixels average
/// less of a camera's noise. Patches where the sensor clips, and masked ones, do not count. Few clean images have so
/// much as 0.6; one that is textured all over has what its texture leaves there. 0 where there are too few patches to
/// tell.
float image_noise(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int compared_width,
                  ThreadPool& pool);

}  // namespace pmsp
