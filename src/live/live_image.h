// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/live.h"
#include "pmsp/types.h"

namespace pmsp {

/// The image as red, green and blue: a view of its own pixels where they are that already, else of `converted`.
ImageView<const Rgb> rgb_view(const LiveImage& image, Image<Rgb>& converted);

/// Throws InvalidInput, naming the keyframe, unless there are pixels, rows do not overlap and sizes are as expected,
/// those of the prior depth, too. `mask`: null = none.
void check_image(const LiveKeyframe& keyframe, const Image<std::uint8_t>* mask);

}  // namespace pmsp
