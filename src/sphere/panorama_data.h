// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>

#include "pmsp/stages.h"
#include "sphere/cube_map.h"
#include "util/inside.h"

namespace pmsp {

/// Minimum size of depth maps.
constexpr int kMinPanoramaWidth = 16;
constexpr int kMinPanoramaHeight = 8;

/// Minimum distance of patch centres from masked pixels [px]: samples within it carry most of a patch's weight.
constexpr double kPatchReachPx = 3.0;

struct PanoramaData {
  int width = 0;
  int height = 0;
  Image<Rgb> color;
  Image<std::uint8_t> mask;  ///< empty without a mask
  CubeMap gray;
  float noise = 0.0F;  ///< see image_noise
  CubeMap matchable;   ///< patch centres allowed in source views; empty without a mask
};

/// As Panorama's constructor, without the noise. `nodes`: of the last image; computed again if of another size.
PanoramaData prepare_panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
                              double image_scale, const Executor& executor, std::optional<CubeNodes>& nodes);

}  // namespace pmsp
