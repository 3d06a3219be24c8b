// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <utility>

#include "elementary.h"
#include "sphere/image_noise.h"
#include "synth/rng.h"

using namespace pmsp;

namespace {

constexpr int kWidth = 480;
constexpr int kHeight = 240;

ThreadPool& pool() {
  static ThreadPool pool(2);
  return pool;
}

/// A smooth picture, with noise of this standard deviation [gray levels]; texture east of longitude `textured_from`.
Image<Rgb> picture(double noise, double textured_from = 4.0, double brightness = 120.0) {
  Image<Rgb> image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double lon = 2.0 * kernels::kPi * (x + 0.5) / kWidth - kernels::kPi;
      double gray = brightness + 20.0 * std::sin(lon) + 0.05 * y;
      if (lon > textured_from) gray += 40.0 * std::sin(0.9 * x) * std::sin(0.7 * y);
      gray += noise * synth::gaussian(7, static_cast<std::uint64_t>(y * kWidth + x));
      const auto byte = static_cast<std::uint8_t>(std::clamp(gray + 0.5, 0.0, 255.0));
      image(x, y) = {byte, byte, byte};
    }
  }
  return image;
}

float noise_of(const Image<Rgb>& image, int width = kWidth) {
  return image_noise(image.view(), {}, width, width, pool());
}

}  // namespace

TEST_CASE("an image's noise is estimated from its least textured places", "[noise]") {
  CHECK(noise_of(picture(0.0)) < 0.2F);  // of rounding to bytes
  const float two = noise_of(picture(2.0));
  const float four = noise_of(picture(4.0));
  CHECK(two > 1.0F);
  CHECK(two < 4.0F);  // the variance itself; the barest patches have less
  CHECK(four > 3.0F * two);
  CHECK(four < 5.0F * two);
  CHECK(noise_of(picture(2.0, -1.5)) == Approx(two).epsilon(0.3));  // three quarters are textured
  CHECK(noise_of(picture(0.0, -4.0)) > 100.0F);                     // all of it is
}

TEST_CASE("a smaller depth map averages noise away", "[noise]") {
  const Image<Rgb> image = picture(4.0);
  CHECK(noise_of(image, kWidth / 3) < 0.25F * noise_of(image));
}

TEST_CASE("noise is that of the matched pixels if these have more than depth map pixels", "[noise]") {
  const Image<Rgb> image = picture(4.0);
  CHECK(image_noise(image.view(), {}, kWidth / 3, kWidth, pool()) == noise_of(image));
  CHECK(image_noise(image.view(), {}, kWidth, kWidth / 3, pool()) == noise_of(image));
}

TEST_CASE("masked or clipped pixels do not affect the noise estimate", "[noise]") {
  Image<Rgb> image = picture(3.0);
  const float noise = noise_of(image);
  Image<std::uint8_t> mask(kWidth, kHeight, 255);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 3; ++x) {
      image(x, y) = {90, 90, 90};
      mask(x, y) = 0;
    }
  }
  CHECK(noise_of(image) < 1e-6F);
  CHECK(image_noise(image.view(), mask.view(), kWidth, kWidth, pool()) == Approx(noise).epsilon(0.3));
  for (int y = 0; y < kHeight; ++y) std::fill(image.row(y), image.row(y) + kWidth / 3, Rgb{255, 255, 255});
  CHECK(noise_of(image) == Approx(noise).epsilon(0.3));
  CHECK(noise_of(Image<Rgb>(kWidth, kHeight)) == 0.0F);
}

TEST_CASE("noise is measured in images of any size", "[noise]") {
  for (const auto& [width, height] :
       {std::pair(16, 8), std::pair(64, 30), std::pair(2, 2), std::pair(960, 480), std::pair(6000, 3000)}) {
    CAPTURE(width, height);
    Image<Rgb> image(width, height, {100, 100, 100});
    CHECK(image_noise(image.view(), {}, 64, 128, pool()) < 1e-6F);
  }
}
