// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/kernel_helpers.h"
#include "pmsp/stages.h"
#include "sphere/area_resize.h"

using namespace pmsp;
using pmsp::test::Draws;

namespace {

Image<Rgb> random_image(int width, int height, std::uint64_t seed) {
  Draws draws(seed);
  Image<Rgb> image(width, height);
  const auto byte = [&] { return static_cast<std::uint8_t>(draws.below(256)); };
  for (Rgb& pixel : image.pixels()) pixel = {byte(), byte(), byte()};
  return image;
}

Eigen::Vector3d value(const Rgb& pixel) { return {pixel.r + 0.0, pixel.g + 0.0, pixel.b + 0.0}; }

Eigen::Vector3d mean(const Image<Rgb>& image) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Rgb& pixel : image.pixels()) sum += value(pixel);
  return sum / static_cast<double>(image.size());
}

Eigen::Vector3d mean(const Image<Eigen::Vector3f>& image) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& pixel : image.pixels()) sum += pixel.cast<double>();
  return sum / static_cast<double>(image.size());
}

/// Share of target element i that source element k covers, in whole numbers up to the last division.
double overlap(int source, int target, int i, int k) {
  const long long low = std::max<long long>(1LL * i * source, 1LL * k * target);
  const long long high = std::min<long long>((i + 1LL) * source, (k + 1LL) * target);
  return high > low ? static_cast<double>(high - low) / source : 0.0;
}

Eigen::Vector3d box_mean(const Image<Rgb>& image, int width, int height, int x, int y) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int j = y * image.height() / height; j < image.height() && j * height < (y + 1) * image.height(); ++j) {
    for (int i = x * image.width() / width; i < image.width() && i * width < (x + 1) * image.width(); ++i) {
      sum += overlap(image.width(), width, x, i) * overlap(image.height(), height, y, j) * value(image(i, j));
    }
  }
  return sum;
}

double worst_against_box_means(int source_width, int source_height, int width, int height) {
  ThreadPool pool(2);
  const Image<Rgb> image = random_image(source_width, source_height, 1);
  const Image<Eigen::Vector3f> resized = area_resize(image.view(), width, height, pool);
  double worst = 0.0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector3d truth = box_mean(image, width, height, x, y);
      worst = std::max(worst, (resized(x, y).cast<double>() - truth).cwiseAbs().maxCoeff());
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("shrinking averages over exact areas, whole factors and others") {
  for (const auto& size : std::vector<std::array<int, 4>>{{64, 32, 16, 8},
                                                          {90, 60, 30, 20},
                                                          {64, 32, 64, 32},
                                                          {64, 32, 50, 26},
                                                          {192, 96, 130, 74},
                                                          {100, 50, 6, 4},
                                                          {64, 32, 2, 2}}) {
    INFO(size[0] << " x " << size[1] << " to " << size[2] << " x " << size[3]);
    CHECK(worst_against_box_means(size[0], size[1], size[2], size[3]) < 2e-3);
  }
}

TEST_CASE("shrinking averages over exact areas for all pairs of widths") {
  // Factors whose multiples miss a whole number by a rounding error are among them.
  double worst = 0.0;
  std::pair<int, int> at;
  for (int source = 2; source <= 240; source += 2) {
    for (int target = 2; target <= source; target += 2) {
      const double error = worst_against_box_means(source, 2, target, 2);
      if (error <= worst) continue;
      worst = error;
      at = {source, target};
    }
  }
  INFO("worst for " << at.first << " to " << at.second);
  CHECK(worst < 2e-3);
}

TEST_CASE("the mean is kept") {
  ThreadPool pool(2);
  const Image<Rgb> image = random_image(192, 96, 2);
  for (const auto& size : {std::make_pair(64, 32), {192, 96}, {100, 62}, {384, 96}, {38, 18}}) {
    const Image<Eigen::Vector3f> resized = area_resize(image.view(), size.first, size.second, pool);
    CHECK((mean(resized) - mean(image)).cwiseAbs().maxCoeff() < 0.01);
  }
}

TEST_CASE("the same size gives the same image") {
  ThreadPool pool(1);
  const Image<Rgb> image = random_image(40, 20, 3);
  const Image<Eigen::Vector3f> resized = area_resize(image.view(), 40, 20, pool);
  for (std::size_t i = 0; i < image.size(); ++i) {
    REQUIRE((resized.pixels()[i].cast<double>() - value(image.pixels()[i])).norm() < 1e-4);
  }
}

TEST_CASE("enlarging interpolates linearly between pixel centres, x wraps, y does not") {
  ThreadPool pool(2);
  const Image<Rgb> image = random_image(16, 8, 4);
  for (const auto& size : {std::make_pair(32, 16), {50, 30}, {18, 10}}) {
    const Image<Eigen::Vector3f> resized = area_resize(image.view(), size.first, size.second, pool);
    double worst = 0.0;
    for (int y = 0; y < size.second; ++y) {
      for (int x = 0; x < size.first; ++x) {
        const double sx = (x + 0.5) * 16 / size.first - 0.5;
        const double sy = (y + 0.5) * 8 / size.second - 0.5;
        Eigen::Vector3d truth = Eigen::Vector3d::Zero();
        for (int j = -1; j <= 8; ++j) {
          for (int i = -1; i <= 16; ++i) {
            const double weight = std::max(0.0, 1.0 - std::fabs(sx - i)) * std::max(0.0, 1.0 - std::fabs(sy - j));
            truth += weight * value(image((i + 16) % 16, std::clamp(j, 0, 7)));
          }
        }
        worst = std::max(worst, (resized(x, y).cast<double>() - truth).cwiseAbs().maxCoeff());
      }
    }
    INFO(size.first << " x " << size.second);
    CHECK(worst < 1e-3);
  }
}

TEST_CASE("rows with a stride are read correctly") {
  ThreadPool pool(1);
  const Image<Rgb> image = random_image(48, 16, 5);
  const ImageView<const Rgb> part(image.view().data + 8, 32, 16, 48);
  Image<Rgb> copy(32, 16);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 32; ++x) copy(x, y) = image(x + 8, y);
  }
  const auto a = area_resize(part, 10, 6, pool);
  const auto b = area_resize(copy.view(), 10, 6, pool);
  CHECK(a.pixels() == b.pixels());
}

TEST_CASE("shrink_mask: a pixel is usable exactly if all covered pixels are usable") {
  Draws draws(6);
  for (const auto& size : {std::make_pair(16, 8), {50, 26}, {64, 32}, {62, 30}, {96, 48}, {130, 66}}) {
    Image<std::uint8_t> mask(64, 32, 255);
    for (int i = 0; i < 25; ++i) mask(draws.below(64), draws.below(32)) = 0;
    mask(0, 0) = 0;
    mask(63, 31) = 0;
    mask(5, 5) = 1;  // usable too: not 0
    const Image<std::uint8_t> result = shrink_mask(mask.view(), size.first, size.second);
    int usable = 0;
    for (int y = 0; y < size.second; ++y) {
      for (int x = 0; x < size.first; ++x) {
        bool all = true;
        for (int j = 0; j < 32; ++j) {
          for (int i = 0; i < 64; ++i) {
            const bool covered = overlap(64, size.first, x, i) > 0.0 && overlap(32, size.second, y, j) > 0.0;
            if (covered && mask(i, j) == 0) all = false;
          }
        }
        REQUIRE(result(x, y) == (all ? 255 : 0));
        if (all) ++usable;
      }
    }
    CHECK(usable > 0);
  }
}
