// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "pmsp/types.h"

namespace pmsp::tool {

/// Returns a depth map for a page, at most 1024 columns of it; "" without depth. `scale`: the depths' unit in units of
/// the page. Layout: width and height (32 bits), smallest depth (double), little-endian; then a zlib stream of three
/// planes of width x height bytes: low byte and high byte of the depths, and 15 times the square root of the confidence
/// (0 = no depth). A depth is exp(code / 1024) times the smallest one, which is right to 0.05 %, and stored as the
/// difference d of its code to that of the previous pixel with a depth, row by row, the first to 0: as 2 d, or -2 d - 1
/// if negative. Throws OutputError.
std::string page_depth(ImageView<const float> depths, ImageView<const float> confidences, double scale);

}  // namespace pmsp::tool
