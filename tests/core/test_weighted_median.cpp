// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>

#include "core/helpers.h"
#include "elementary.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 80;
constexpr float kWall = 4.0F;
constexpr float kPlate = 2.0F;

/// A plate of 40 x 24 pixels before a wall, each of one colour, with noise.
struct Scene {
  int left = 60, top = 28;

  bool on_plate(int x, int y, int grown = 0) const {
    const int dx = (x - left + 2 * kWidth) % kWidth;
    const int from_left = dx >= kWidth - grown ? dx - kWidth : dx;
    return from_left >= -grown && from_left < 40 + grown && y >= top - grown && y < top + 24 + grown;
  }
  Image<Rgb> image() const {
    Image<Rgb> image(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double noise = 3.0 * synth::gaussian(5, static_cast<std::uint64_t>(y * kWidth + x));
        const double gray = (on_plate(x, y) ? 150.0 : 80.0) + noise;
        const auto byte = static_cast<std::uint8_t>(gray + 0.5);
        image(x, y) = {byte, byte, static_cast<std::uint8_t>(byte / 2)};
      }
    }
    return image;
  }
  Panorama panorama(ImageView<const std::uint8_t> mask = {}) const {
    const Image<Rgb> image = this->image();
    return {image.view(), mask, kWidth, kHeight, Executor(1)};
  }
  /// Planes that face the camera; the plate is enlarged by `grown` pixels.
  PlaneMap planes(int grown) const {
    PlaneMap map(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) set(map, x, y, on_plate(x, y, grown) ? kPlate : kWall);
    }
    return map;
  }
  static void set(PlaneMap& map, int x, int y, float depth) {
    const Eigen::Vector3d bearing = bearing_from_pixel({x + 0.5, y + 0.5}, kWidth, kHeight);
    map.x(x, y) = static_cast<float>(bearing.x()) / depth;
    map.y(x, y) = static_cast<float>(bearing.y()) / depth;
    map.z(x, y) = static_cast<float>(bearing.z()) / depth;
    map.score(x, y) = 0.9F;
  }
};

/// Share of the pixels whose depth is within 3 % of the truth.
double right(const Scene& scene, const PlaneMap& map) {
  int count = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Eigen::Vector3d bearing = bearing_from_pixel({x + 0.5, y + 0.5}, kWidth, kHeight);
      const double inverse = bearing.dot(Eigen::Vector3d(map.x(x, y), map.y(x, y), map.z(x, y)));
      count += std::abs(inverse * (scene.on_plate(x, y) ? kPlate : kWall) - 1.0) < 0.03 ? 1 : 0;
    }
  }
  return static_cast<double>(count) / (kWidth * kHeight);
}

bool equal(const PlaneMap& a, const PlaneMap& b) {
  return same(a.x, b.x) && same(a.y, b.y) && same(a.z, b.z) && same(a.score, b.score);
}

}  // namespace

TEST_CASE("the weighted median moves depth edges to where the colours change", "[median]") {
  for (const Scene scene : {Scene{}, Scene{140, 28}, Scene{60, 4}}) {  // in the middle, over the seam, near a pole
    CAPTURE(scene.left, scene.top);
    const Panorama panorama = scene.panorama();
    const PlaneMap grown = scene.planes(2);
    const double before = right(scene, grown);
    const double after = right(scene, weighted_median_filter(grown, panorama, Executor(2)));
    CHECK(before < 0.98);
    CHECK(1.0 - after < 0.45 * (1.0 - before));
  }
}

TEST_CASE("the weighted median covers the same angle near a pole as at the equator", "[median]") {
  const Scene scene{60, 4};
  PlaneMap grown = scene.planes(0);
  for (int y = 4; y < 28; ++y) {
    const double cos_lat = std::sin((y + 0.5) / kHeight * kernels::kPi);
    const int columns = static_cast<int>(std::lround(2.0 / cos_lat));
    for (int i = 1; i <= columns; ++i) {
      Scene::set(grown, 60 - i, y, kPlate);
      Scene::set(grown, 99 + i, y, kPlate);
    }
  }
  const auto wrong = [&](const PlaneMap& map) {  // of the rows nearest to the pole
    int count = 0;
    for (int y = 4; y < 10; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Eigen::Vector3d bearing = bearing_from_pixel({x + 0.5, y + 0.5}, kWidth, kHeight);
        const double inverse = bearing.dot(Eigen::Vector3d(map.x(x, y), map.y(x, y), map.z(x, y)));
        count += std::abs(inverse * (scene.on_plate(x, y) ? kPlate : kWall) - 1.0) < 0.03 ? 0 : 1;
      }
    }
    return count;
  };
  const int before = wrong(grown);
  const int after = wrong(weighted_median_filter(grown, scene.panorama(), Executor(2)));
  CAPTURE(before, after);
  CHECK(before > 60);
  CHECK(after < before / 8);
}

TEST_CASE("the weighted median keeps correct depths including thin structures", "[median]") {
  const Scene scene;
  const PlaneMap truth = scene.planes(0);
  CHECK(right(scene, weighted_median_filter(truth, scene.panorama(), Executor(2))) > 0.995);

  Image<Rgb> image = scene.image();  // a rail of two pixels before the wall
  PlaneMap with_rail = truth;
  for (int x = 0; x < kWidth; ++x) {
    for (const int y : {60, 61}) {
      image(x, y) = {250, 250, 250};
      Scene::set(with_rail, x, y, kPlate);
    }
  }
  const Panorama panorama(image.view(), {}, kWidth, kHeight, Executor(1));
  const PlaneMap filtered = weighted_median_filter(with_rail, panorama, Executor(2));
  int kept = 0;
  for (int x = 0; x < kWidth; ++x) kept += filtered.z(x, 60) == with_rail.z(x, 60) ? 1 : 0;
  CHECK(kept > kWidth * 95 / 100);
}

TEST_CASE("a cable of nearly the wall's colour stays and a single pixel does not", "[median]") {
  const Scene scene;
  Image<Rgb> image = scene.image();
  PlaneMap map = scene.planes(0);
  const auto draw = [&](int x, int y) {
    image(x, y) = {88, 88, 44};  // the wall: 80, with noise of 3
    Scene::set(map, x, y, kPlate);
  };
  for (int y = 10; y < 70; ++y) {
    for (const int x : {20, 21, 90 + y}) draw(x, y);  // one upright, one askew
  }
  draw(5, 40);
  draw(40, 50);
  const Panorama panorama(image.view(), {}, kWidth, kHeight, Executor(1));
  const PlaneMap filtered = weighted_median_filter(map, panorama, Executor(2));
  const auto stays = [&](int x, int y) { return filtered.z(x, y) == map.z(x, y); };
  int kept = 0;
  for (int y = 20; y < 60; ++y) {
    for (const int x : {20, 21, 90 + y}) kept += stays(x, y) ? 1 : 0;
  }
  CHECK(kept > 40 * 3 * 95 / 100);
  CHECK_FALSE(stays(5, 40));
  CHECK_FALSE(stays(40, 50));
}

TEST_CASE("the weighted median fills holes but no masked pixels", "[median]") {
  const Scene scene;
  Image<std::uint8_t> mask(kWidth, kHeight, 255);
  PlaneMap map = scene.planes(0);
  for (int y = 40; y < 44; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x >= 100) mask(x, y) = 0;
      map.x(x, y) = map.y(x, y) = map.z(x, y) = map.score(x, y) = 0.0F;
    }
  }
  const PlaneMap filtered = weighted_median_filter(map, scene.panorama(mask.view()), Executor(2));
  for (int x = 0; x < kWidth; ++x) {
    CAPTURE(x);
    CHECK((filtered.score(x, 41) > 0.0F) == (x < 100));
  }
  CHECK(right(scene, filtered) > 0.97);
}

TEST_CASE("the weighted median is the same for any number of threads and requires equal sizes", "[median]") {
  const Scene scene;
  const Panorama panorama = scene.panorama();
  const PlaneMap map = scene.planes(3);
  const PlaneMap one = weighted_median_filter(map, panorama, Executor(1));
  CHECK(equal(one, weighted_median_filter(map, panorama, Executor(3))));
  CHECK(one.keyframe_id == map.keyframe_id);
  CHECK_THROWS_AS(weighted_median_filter(PlaneMap(kWidth, kHeight / 2), panorama, Executor(1)), InvalidInput);
}
