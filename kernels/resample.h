// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "equirect.h"

// Resampling of an equirectangular image to the faces of a cube.
namespace pmsp::kernels {

/// Equirectangular gray values, row-major, without padding.
struct GrayView {
  const float* data;
  int width, height;
};

/// Pixel (x, y); columns beyond the seam wrap around, rows beyond a pole are those of the opposite meridian.
PMSP_HD float pixel_around(const GrayView& image, int x, int y) {
  if (y < 0 || y >= image.height) {
    y = y < 0 ? -1 - y : 2 * image.height - 1 - y;
    x += image.width / 2;
  }
  x %= image.width;
  return image.data[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                    static_cast<std::size_t>(x < 0 ? x + image.width : x)];
}

/// Weights of four values for position `t` (0 to 1) between the second and the third (Catmull-Rom; Keys 1981).
PMSP_HD void cubic_weights(float t, float* weights) {
  weights[0] = ((-0.5F * t + 1.0F) * t - 0.5F) * t;
  weights[1] = (1.5F * t - 2.5F) * t * t + 1.0F;
  weights[2] = ((-1.5F * t + 2.0F) * t + 0.5F) * t;
  weights[3] = (0.5F * t - 0.5F) * t * t;
}

/// Value at an image point, by cubic convolution.
PMSP_HD float sample_cubic(const GrayView& image, const Pixel<float>& at) {
  const float x = at.x - 0.5F;
  const float y = at.y - 0.5F;
  const int x0 = static_cast<int>(::floorf(x));
  const int y0 = static_cast<int>(::floorf(y));
  float wx[4];
  float wy[4];
  cubic_weights(x - static_cast<float>(x0), wx);
  cubic_weights(y - static_cast<float>(y0), wy);
  const bool inside = x0 >= 1 && y0 >= 1 && x0 + 2 < image.width && y0 + 2 < image.height;
  float sum = 0.0F;
  for (int j = 0; j < 4; ++j) {
    float line = 0.0F;
    if (inside) {
      const float* row = image.data + static_cast<std::size_t>(y0 - 1 + j) * static_cast<std::size_t>(image.width) +
                         static_cast<std::size_t>(x0 - 1);
      line = wx[0] * row[0] + wx[1] * row[1] + wx[2] * row[2] + wx[3] * row[3];
    } else {
      for (int i = 0; i < 4; ++i) line += wx[i] * pixel_around(image, x0 - 1 + i, y0 - 1 + j);
    }
    sum += wy[j] * line;
  }
  return sum;
}

/// Value in a direction (any length > 0).
PMSP_HD float sample_cubic(const GrayView& image, const Vec3<float>& direction) {
  return sample_cubic(image, project(direction, static_cast<float>(image.width), static_cast<float>(image.height)));
}

}  // namespace pmsp::kernels
