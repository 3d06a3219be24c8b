// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>

#include "pmsp/stages.h"
#include "sphere/cube_map.h"
#include "util/inside.h"

namespace pmsp {

/// Smallest depth map.
constexpr int kMinPanoramaWidth = 16;
constexpr int kMinPanoramaHeight = 8;

/// Samples within this of a patch's centre carry most of its weight: so far a patch stays away from masked pixels.
constexpr double kPatchReachPx = 3.0;

struct PanoramaData {
  int width = 0;
  int height = 0;
  Image<Rgb> color;
  Image<std::uint8_t> usable;  ///< empty without a mask
  CubeMap gray;
  float noise = 0.0F;  ///< see image_noise
  CubeMap matchable;   ///< where neighbours may be sampled; empty without a mask
};

/// As Panorama's constructor, but for the noise. `nodes`: those of the last image; found anew where they don't fit.
PanoramaData prepare_panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
                              double image_scale, const Executor& executor, std::optional<CubeNodes>& nodes);

}  // namespace pmsp
