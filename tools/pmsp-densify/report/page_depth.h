// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "pmsp/types.h"

namespace pmsp::tool {

/// Depth map of a page. `bytes`: zlib stream of three planes of `width` x `height` bytes: low byte and high byte of the
/// depths, and 15 times the square root of the confidence (0 = no depth). A depth is `least` *
/// exp(code / 1024), which is right to 0.05 %, and stored as the difference d of its code to that of the previous pixel
/// with a depth, row by row, the first to 0: as 2 d, or -2 d - 1 if negative.
struct PageDepth {
  int width = 0, height = 0;
  double least = 0.0;  ///< smallest depth; 0 without depth
  std::string bytes;
};

/// Returns a depth map, at most 1024 columns of it. `scale`: the depths' unit in units of the page.
/// Throws OutputError.
PageDepth page_depth(const DepthMap& map, double scale);

}  // namespace pmsp::tool
