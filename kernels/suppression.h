// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "confidence.h"
#include "stage.h"

// Non-maximum suppression of confidence. A depth with an expected error above its distance to a clearly more accurate
// one adds no information: it belongs to the blurred edge of a near object, or roughens a bare wall.
namespace pmsp::kernels {

/// Rings of pixels, at distances of 1 and 2 pixels. Larger ones would remove points that nearby points do not replace.
constexpr int kSuppressionRings = 2;
constexpr float kClearlyMoreExact = 0.75F;  ///< maximum expected error, over that of the suppressed pixel

/// Whether a pixel is not suppressed. It is suppressed by a clearly more accurate one with a surface within `radius`
/// times the pixel's own expected error, both across its ray and along it.
template <class F, class Map>
PMSP_HD MaskOf<F> is_best_around(const FilteredMap<Map>& map, const GridView& grid, const RowPixels<F>& at,
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
      const IntOf<F> there = wrapped_index(grid, at, dx, (k / 3 - 1) * distance);
      const MaskOf<F> exact = error_of_confidence(gather<F>(map.confidence, there)) <=
                              F(kClearlyMoreExact) * error;  // without depth: confidence 0, maximum error
      const F off = abs(depth * dot(plane_at<F>(map, there), bearing) - F(1));
      found = select(open & exact & (off <= reach), F(1), found);
    }
  }
  return found <= F(0);
}

}  // namespace pmsp::kernels
