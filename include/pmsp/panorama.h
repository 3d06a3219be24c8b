// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/options.h"

namespace pmsp {

struct PanoramaData;

/// Resizes a mask: 255 where all that a target pixel covers is usable (nonzero), else 0.
PMSP_API Image<std::uint8_t> shrink_mask(ImageView<const std::uint8_t> mask, int width, int height);

/// A keyframe's image made ready for matching: colours on the grid of the depth map, and gray values, which may be
/// finer, on the six faces of a cube, which is how neighbours are looked up (one division instead of two arcus
/// functions a sample). Resampling averages over each pixel's area; near the poles, where columns crowd, over an area
/// as wide as at the equator.
class PMSP_API Panorama {
 public:
  /// `image`: equirectangular, any even size. `mask`: same size or empty; 0 = ignore. `width`, `height`: of the depth
  /// map, even. `image_scale`: see PatchMatchOptions. Throws InvalidInput.
  Panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
           const Executor& executor, double image_scale = PatchMatchOptions().image_scale);
  ~Panorama();
  Panorama(Panorama&&) noexcept;
  Panorama& operator=(Panorama&&) noexcept;

  int width() const;
  int height() const;

  /// Colours, `width` x `height`.
  const Image<Rgb>& color() const;

  /// 255 where a depth is wanted, 0 where the mask forbids it (a pixel that covers any masked pixel is masked); `width`
  /// x `height`; empty without a mask.
  const Image<std::uint8_t>& usable() const;

 private:
  friend struct Inside;
  std::unique_ptr<PanoramaData> data_;
};

}  // namespace pmsp
