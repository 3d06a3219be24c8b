// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "confidence.h"
#include "equirect.h"
#include "plane.h"

// Weights of fusion, and the search for pixels around a projected point.
namespace pmsp::kernels {

/// Relative error that a depth has in common with its neighbourhood, at any confidence: limits the weight of a single
/// map.
constexpr float kCommonError = 0.001F;

/// Weight of a map's depth: inverse variance of the distance. With photometric scores as confidences (maps before the
/// consistency filter) weights have the same order.
template <class F>
PMSP_HD F fusion_weight(const F& confidence, const F& depth) {
  const F error = error_of_confidence(confidence);
  return F(1) / ((error * error + F(kCommonError * kCommonError)) * (depth * depth));
}

/// Calls is_it(index) for the pixels of a map whose centres lie within `spacing` pixels (at the equator) of an image
/// point, until it returns true. Near the poles these are many, since columns converge. For a search by several
/// threads: every `threads`-th pixel of a row, from the `thread`-th.
template <class IsIt>
PMSP_HD void find_within(const Pixel<float>& at, float spacing, const float* cos_lat, int width, int height,
                         const IsIt& is_it, int thread = 0, int threads = 1) {
  const int first_row = static_cast<int>(max(0.0F, ::floorf(at.y - spacing)));
  const int last_row = static_cast<int>(min(static_cast<float>(height - 1), ::floorf(at.y + spacing)));
  for (int row = first_row; row <= last_row; ++row) {
    const float dy = static_cast<float>(row) + 0.5F - at.y;
    if (abs(dy) > spacing) continue;
    const float reach = min(sqrt(spacing * spacing - dy * dy) / cos_lat[row], 0.5F * static_cast<float>(width) - 1.0F);
    const int last = static_cast<int>(::floorf(at.x + reach - 0.5F));
    const int first = static_cast<int>(::ceilf(at.x - reach - 0.5F));
    for (int column = first + thread; column <= last; column += threads) {
      if (is_it(row * width + (column + width) % width)) return;
    }
  }
}

/// As find_within, for all of these pixels.
template <class Mark>
PMSP_HD void for_each_within(const Pixel<float>& at, float spacing, const float* cos_lat, int width, int height,
                             const Mark& mark) {
  find_within(at, spacing, cos_lat, width, height, [&](int pixel) {
    mark(pixel);
    return false;
  });
}

}  // namespace pmsp::kernels
