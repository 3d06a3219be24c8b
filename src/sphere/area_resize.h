// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

#include "pmsp/image.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Resizes an equirectangular image: each target pixel is the mean over the area that it covers (partial pixels by
/// their share), or, when enlarging, linear interpolation between pixel centres. x wraps. Values stay on the scale 0 to
/// 255.
Image<Eigen::Vector3f> area_resize(ImageView<const Rgb> image, int width, int height, ThreadPool& pool);

/// Resizes a mask: 255 where all that a target pixel covers is usable (nonzero), else 0.
Image<std::uint8_t> shrink_mask(ImageView<const std::uint8_t> mask, int width, int height);

}  // namespace pmsp
