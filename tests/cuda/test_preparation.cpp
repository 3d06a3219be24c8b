// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/helpers.h"
#include "cuda/on_device.h"
#include "cuda/prepared.h"
#include "pmsp/stages.h"
#include "sphere/area_resize.h"
#include "sphere/panorama_data.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

std::vector<float> random_directions(int count) {
  std::vector<float> result;
  for (int i = 0; i < 3 * count; ++i) {
    result.push_back(static_cast<float>(synth::gaussian(5, static_cast<std::uint64_t>(i))));
  }
  return result;
}

/// Something smooth on the sphere, 38 to 218.
double smooth(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d d = direction.normalized();
  return 128.0 + 60.0 * d.x() * d.y() * 2.0 - 20.0 * d.z() + 10.0 * d.y();
}

Eigen::Vector3d direction_at(const std::vector<float>& directions, std::size_t i) {
  return Eigen::Vector3f(directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]).cast<double>();
}

Image<std::uint8_t> blotchy_mask(int width, int height) {
  Image<std::uint8_t> mask(width, height, 255);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (y > height * 9 / 10 || (x / 40 + y / 40) % 9 == 0) mask(x, y) = 0;
    }
  }
  return mask;
}

/// Images and depth maps: reduced, odd reduction, equal, enlarged.
struct Sizes {
  int image_width, image_height, width, height;
};
const std::vector<Sizes>& sizes() {
  static const std::vector<Sizes> kSizes = {
      {256, 128, 128, 64}, {250, 126, 98, 50}, {128, 64, 128, 64}, {96, 48, 128, 64}};
  return kSizes;
}

}  // namespace

TEST_CASE("a smooth panorama is read back from the texture, on all faces", "[cuda][prepare][small]") {
  for (const int width : {64, 642}) {
    const int height = width / 2;
    Image<float> gray(width, height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) gray(x, y) = static_cast<float>(smooth(bearing_of(gray, x, y)));
    }
    const auto cube = cube_texture(gray.pixels(), width, height);
    const std::vector<float> directions = random_directions(20000);
    const std::vector<float> found = texture_samples({cube->texture()}, directions);
    double worst = 0.0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      worst = std::max(worst, std::abs(static_cast<double>(found[i]) - smooth(direction_at(directions, i))));
    }
    CAPTURE(width, worst);
    CHECK(worst < (width == 64 ? 4.0 : 0.5));
  }
}

TEST_CASE("colours equal the CPU's", "[cuda][prepare][small]") {
  for (const Sizes& size : sizes()) {
    CAPTURE(size.image_width, size.image_height, size.width, size.height);
    synth::Recipe recipe = small_recipe(size.image_width, 1);
    recipe.height = size.image_height;
    recipe.mission.landmarks.min_views = 1;
    const synth::Mission mission = synth::textured_room(recipe);
    const Image<Rgb>& image = mission.frames[0].image;
    const Image<std::uint8_t> mask = blotchy_mask(image.width(), image.height());
    const Panorama cpu(image.view(), mask.view(), size.width, size.height, Executor(), 1.0);
    const PreparedOnDevice device = prepare_on_device(image.view(), mask.view(), size.width, size.height);
    std::size_t different = 0;
    int worst = 0;
    std::size_t mask_different = 0;
    for (std::size_t i = 0; i < device.color.size(); ++i) {
      const Rgb& expected = cpu.color().pixels()[i];
      const uchar4& found = device.color[i];
      const int off =
          std::max({std::abs(expected.r - found.x), std::abs(expected.g - found.y), std::abs(expected.b - found.z)});
      worst = std::max(worst, off);
      different += off != 0 ? 1 : 0;
      mask_different += cpu.mask().pixels()[i] != found.w ? 1 : 0;
    }
    CHECK(worst <= 1);  // where a mean is nearly half-way between two levels
    CHECK(different <= device.color.size() / 100);
    CHECK(mask_different == 0);
  }
}

TEST_CASE("gray values on the cube equal the CPU's", "[cuda][prepare][small]") {
  // Enlarged, so that it hardly matters that texels lie elsewhere.
  const synth::Mission mission = synth::sphere_inside(small_recipe(128));
  ThreadPool pool(1);
  const Image<Eigen::Vector3f> smooth = area_resize(mission.frames[0].image.view(), 512, 256, pool);
  Image<Rgb> enlarged(512, 256);
  for (std::size_t i = 0; i < enlarged.pixels().size(); ++i) {
    const auto byte = [&](int channel) { return static_cast<std::uint8_t>(smooth.pixels()[i][channel] + 0.5F); };
    enlarged.pixels()[i] = {byte(0), byte(1), byte(2)};
  }
  const ImageView<const Rgb> image = enlarged.view();
  const Panorama cpu(image, {}, 512, 256, Executor(), 1.0);
  const PreparedOnDevice device = prepare_on_device(image, {}, 512, 256);
  const std::vector<float> directions = random_directions(20000);
  const std::vector<float> found = texture_samples({device.cube->texture()}, directions);
  const kernels::CubeView cube = impl_of(cpu).gray.view();
  double sum = 0.0;
  double mean = 0.0;
  double variance = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const kernels::Vec3<float> d{directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]};
    const double expected = static_cast<double>(kernels::sample(cube, d));
    sum += std::pow(static_cast<double>(found[i]) - expected, 2);
    mean += expected;
    variance += expected * expected;
  }
  const double n = static_cast<double>(found.size());
  const double rms = std::sqrt(sum / n);
  const double deviation = std::sqrt(variance / n - std::pow(mean / n, 2));
  CAPTURE(rms, deviation);
  CHECK(deviation > 10.0);
  CHECK(rms < 0.05 * deviation);
}

TEST_CASE("patches keep the same distance from the mask as on the CPU", "[cuda][prepare][small]") {
  const synth::Mission mission = synth::sphere_inside(small_recipe(512));
  const ImageView<const Rgb> image = mission.frames[0].image.view();
  const Image<std::uint8_t> mask = blotchy_mask(512, 256);
  const Panorama cpu(image, mask.view(), 256, 128, Executor(), 1.0);
  const PreparedOnDevice device = prepare_on_device(image, mask.view(), 256, 128);
  const std::vector<float> directions = random_directions(20000);
  const std::vector<float> found = texture_samples({device.usable->texture()}, directions);
  const kernels::CubeView cube = impl_of(cpu).matchable.view();
  std::size_t different = 0;
  std::size_t forbidden = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const kernels::Vec3<float> d{directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]};
    const bool allowed = found[i] > 127.0F;
    different += allowed != (kernels::sample(cube, d) > 127.0F) ? 1 : 0;
    forbidden += allowed ? 0 : 1;
  }
  CAPTURE(different, forbidden);
  CHECK(different < found.size() / 50);  // along borders, texels lie elsewhere
  CHECK(forbidden > found.size() / 10);
  CHECK(forbidden < found.size() * 9 / 10);
}
