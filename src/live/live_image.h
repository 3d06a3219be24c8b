// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/live.h"
#include "pmsp/types.h"

namespace pmsp {

/// Returns the image as RGB: a view of its own pixels if possible, else of `converted`.
ImageView<const Rgb> rgb_view(const LiveImage& image, Image<Rgb>& converted);

/// Throws InvalidInput, with the id, if pixels or owner are missing, rows overlap, or sizes (also of the prior depth)
/// are invalid. `mask`: nullptr = none.
void check_image(const LiveKeyframe& keyframe, const Image<std::uint8_t>* mask);

}  // namespace pmsp
