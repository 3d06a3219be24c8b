// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cuda/memory.h"
#include "pmsp/types.h"

namespace pmsp::test {

/// A keyframe's image as prepared on the device by the kernels of src/cuda/prepare.cu.
struct PreparedOnDevice {
  std::vector<uchar4> color;  ///< w = 255 where a depth is wanted, else 0
  std::vector<float> gray;    ///< rows equalized
  std::unique_ptr<cuda::CubeTexture> cube;
  std::unique_ptr<cuda::CubeTexture> usable;  ///< none without a mask
};
PreparedOnDevice prepare_on_device(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width,
                                   int height);

/// A cube texture of given gray values (equirectangular, `width` a row).
std::unique_ptr<cuda::CubeTexture> cube_texture(const std::vector<float>& gray, int width, int height);

}  // namespace pmsp::test
