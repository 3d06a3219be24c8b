// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "confidence.h"
#include "stage.h"

// Non-maximum suppression of confidence. A depth that may be off by more than the distance to a clearly more exact one
// tells nothing: it is a blurred edge of a near thing, or roughens a bare wall.
namespace pmsp::kernels {

/// Around a pixel, at 1 and 2 pixels. Farther ones are too far to stand for it: rings at 4 and 8 pixels cost more in
/// completeness than they give in accuracy.
constexpr int kSuppressionRings = 2;
constexpr float kClearlyMoreExact = 0.75F;  ///< expected error over that of the pixel that gives way, at most

/// Whether a pixel of the map makes a point although there are others around. It gives way to one that is clearly more
/// exact and whose surface lies within `radius` of the pixel's own expected error, across its ray as along it.
template <class F, class Map>
PMSP_HD MaskOf<F> is_best_around(const FilteredMap<Map>& map, const GridView& grid, const Place<F>& at,
                                 const Vec3<F>& bearing, const F& depth, const F& confidence, float radius) {
  const F error = error_of_confidence(confidence);
  const F reach = F(radius) * error;
  const F pixels = F(static_cast<float>(grid.height) / static_cast<float>(kPi)) * reach;
  const float stretch = column_stretch(grid, at.row, 1 << (kSuppressionRings - 1));
  F found(0);
  for (int ring = 0; ring < kSuppressionRings; ++ring) {
    const int distance = 1 << ring;
    const MaskOf<F> open = (pixels >= F(static_cast<float>(distance))) & (found <= F(0));
    if (!any(open)) break;
    for (int k = 0; k < 9; ++k) {
      if (k == 4) continue;  // the pixel itself
      const int dx = static_cast<int>(stretch * static_cast<float>((k % 3 - 1) * distance));
      const IntOf<F> there = index_beside(grid, at, dx, (k / 3 - 1) * distance);
      const MaskOf<F> exact = error_of_confidence(gather<F>(map.confidence, there)) <=
                              F(kClearlyMoreExact) * error;  // without a depth it is the largest
      const F off = abs(depth * dot(plane_at<F>(map, there), bearing) - F(1));
      found = select(open & exact & (off <= reach), F(1), found);
    }
  }
  return found <= F(0);
}

}  // namespace pmsp::kernels
