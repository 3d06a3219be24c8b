// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

#include "kernels/kernel_helpers.h"
#include "pmsp/camera.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
using pmsp::test::cast;
using pmsp::test::Draws;
using pmsp::test::frame_at;
namespace k = pmsp::kernels;

namespace {

constexpr int kWidth = 5760;
constexpr int kHeight = 2880;

double wrapped(double x, double width) { return x - width * std::floor(x / width + 0.5); }

/// Distance in pixels between the float projection and the exact one of the same direction.
double projection_error(const Vec3<float>& p) {
  const k::Pixel<float> at = k::project(p, static_cast<float>(kWidth), static_cast<float>(kHeight));
  const k::Pixel<double> truth = k::project_exactly(cast<double>(p), kWidth, kHeight);
  return std::max(std::fabs(wrapped(at.x - truth.x, kWidth)), std::fabs(at.y - truth.y));
}

}  // namespace

TEST_CASE("bearing and tangents are orthonormal and point along growing longitude, x and y") {
  Draws draws(1);
  for (int i = 0; i < 2000; ++i) {
    const double x = draws.uniform(0.0, 640.0);
    const double y = draws.uniform(0.5, 319.5);
    const auto at = frame_at(x, y, 640, 320);
    CHECK(k::dot(at.bearing, at.bearing) == Approx(1.0).epsilon(1e-12));
    CHECK(k::dot(at.right, at.right) == Approx(1.0).epsilon(1e-12));
    CHECK(k::dot(at.down, at.down) == Approx(1.0).epsilon(1e-12));
    CHECK(std::fabs(k::dot(at.bearing, at.right)) < 1e-12);
    CHECK(std::fabs(k::dot(at.bearing, at.down)) < 1e-12);
    CHECK(std::fabs(k::dot(at.right, at.down)) < 1e-12);
    CHECK(k::dot(at.right, frame_at(x + 1e-3, y, 640, 320).bearing) > 0.0);
    CHECK(k::dot(at.down, frame_at(x, y + 1e-3, 640, 320).bearing) > 0.0);
  }
}

TEST_CASE("axes: z is the centre of the image, x to the right, y down") {
  const auto at = [](double x, double y, double z) { return k::project_exactly({x, y, z}, 640, 320); };
  CHECK(at(0, 0, 1).x == Approx(320.0));
  CHECK(at(0, 0, 1).y == Approx(160.0));
  CHECK(at(1, 0, 0).x == Approx(480.0));
  CHECK(at(-1, 0, 0).x == Approx(160.0));
  CHECK(at(0, 1, 0).y == Approx(320.0));
  CHECK(at(0, -1, 0).y == Approx(0.0).margin(1e-12));
  CHECK(at(0, 0, -1).x == 0.0);
  CHECK(at(-0.0, 0, -1).x == 0.0);
  CHECK(at(0.0, 1, 1).y == Approx(240.0));
}

TEST_CASE("float projection: error in pixels of the largest images") {
  Draws draws(2);
  double worst = 0.0;
  for (int i = 0; i < 500000; ++i) {
    const double scale = std::exp(draws.uniform(-20.0, 20.0));
    const Vec3<double> d = draws.direction();
    worst = std::max(worst, projection_error(cast<float>(scale * d)));
  }
  for (const float a : {-1.0F, -1e-7F, 0.0F, 1e-7F, 1.0F}) {
    for (const float b : {-1.0F, -1e-7F, 0.0F, 1e-7F, 1.0F}) {
      for (const float c : {-1.0F, 1.0F}) {
        worst =
            std::max({worst, projection_error({a, b, c}), projection_error({a, c, b}), projection_error({c, a, b})});
      }
    }
  }
  INFO("worst " << worst << " px");
  CHECK(worst < 1e-3);
}

TEST_CASE("column and row are in range for every direction, at the seam and the poles too") {
  const float width = static_cast<float>(kWidth);
  const float height = static_cast<float>(kHeight);
  Draws draws(3);
  const auto check = [&](const Vec3<float>& p) {
    const k::Pixel<float> at = k::project(p, width, height);
    const int column = k::column(at.x, kWidth);
    const int row = k::row(at.y, kHeight);
    REQUIRE(column >= 0);
    REQUIRE(column < kWidth);
    REQUIRE(row >= 0);
    REQUIRE(row < kHeight);
  };
  for (int i = 0; i < 200000; ++i) {
    const double near = std::pow(10.0, draws.uniform(-12.0, 0.0));
    const Vec3<double> d = draws.direction();
    check(cast<float>(d));
    check(cast<float>(Vec3<double>{near * d.x, d.y, -1.0}));
    check(cast<float>(Vec3<double>{near * d.x, d.y > 0 ? 1.0 : -1.0, near * d.z}));
  }
  CHECK(k::column(width, kWidth) == 0);
  CHECK(k::column(std::nextafter(width, 0.0F), kWidth) == kWidth - 1);
  CHECK(k::column(-1e-4F, kWidth) == 0);
  CHECK(k::row(height, kHeight) == kHeight - 1);
  CHECK(k::row(-1e-4F, kHeight) == 0);
  CHECK(k::row(0.0F, kHeight) == 0);
}

TEST_CASE("pixel centres project into their own pixel") {
  for (int y = 0; y < 320; ++y) {
    for (int x = 0; x < 640; ++x) {
      const auto bearing = cast<float>(frame_at(x + 0.5, y + 0.5, 640, 320).bearing);
      const k::Pixel<float> at = k::project(bearing, 640.0F, 320.0F);
      REQUIRE(k::column(at.x, 640) == x);
      REQUIRE(k::row(at.y, 320) == y);
    }
  }
}

TEST_CASE("angle_between is exact for tiny, right and straight angles") {
  Draws draws(4);
  for (const double angle : {1e-9, 1e-5, 0.1, 1.0, kernels::kPi / 2.0, 3.0, kernels::kPi - 1e-7}) {
    for (int i = 0; i < 100; ++i) {
      const auto at = frame_at(draws.uniform(0.0, 640.0), draws.uniform(1.0, 319.0), 640, 320);
      const Vec3<double> other = std::cos(angle) * at.bearing + std::sin(angle) * at.right;
      const double factor = std::exp(draws.uniform(-9.0, 9.0));
      CHECK(k::angle_between(at.bearing, factor * other) == Approx(angle).epsilon(1e-6));
    }
  }
  CHECK(k::angle_between({0, 1, 0}, {0, 2, 0}) == 0.0);
  CHECK(k::angle_between({0, 1, 0}, {0, -2, 0}) == Approx(kernels::kPi));
}

TEST_CASE("bearing_from_pixel and pixel_from_bearing undo each other, whatever the length, across the seam") {
  for (const auto& size : {std::pair<int, int>{640, 320}, {1440, 720}, {250, 100}}) {
    const double width = size.first;
    const double height = size.second;
    for (double y = 0.25; y < height; y += height / 41.0) {
      for (double x = -0.75 * width; x < 1.75 * width; x += width / 37.0) {
        const Eigen::Vector3d bearing = bearing_from_pixel({x, y}, size.first, size.second);
        REQUIRE(bearing.norm() == Approx(1.0).epsilon(1e-12));
        const Eigen::Vector2d back = pixel_from_bearing(1e-3 * bearing, size.first, size.second);
        REQUIRE(back.x() >= 0.0);
        REQUIRE(back.x() < width);
        REQUIRE(std::fabs(wrapped(back.x() - x, width)) < 1e-8);
        REQUIRE(std::fabs(back.y() - y) < 1e-8);
        REQUIRE((bearing_from_pixel(back, size.first, size.second) - bearing).norm() < 1e-10);
      }
    }
  }
}

TEST_CASE("the seam and the poles have one image point each") {
  CHECK(pixel_from_bearing({0.0, 0.0, -1.0}, 640, 320).x() == 0.0);
  CHECK(pixel_from_bearing({-1e-12, 0.0, -1.0}, 640, 320).x() == Approx(0.0).margin(1e-6));
  CHECK(pixel_from_bearing({1e-6, 0.0, -1.0}, 640, 320).x() == Approx(640.0).epsilon(1e-6));
  CHECK(pixel_from_bearing({0.0, 5.0, 0.0}, 640, 320).y() == 320.0);
  CHECK(pixel_from_bearing({0.0, -5.0, 0.0}, 640, 320).y() == 0.0);
}

TEST_CASE("cam_from_slam_cam shifts the image by half a pixel") {
  constexpr int kImageWidth = 100;
  const RigidTransform turn = cam_from_slam_cam(kImageWidth);
  CHECK(turn.translation.norm() == 0.0);
  CHECK((turn.rotation * turn.rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-14);
  for (double y = 0.5; y < 50.0; y += 7.0) {
    for (int i = 0; i < kImageWidth; ++i) {
      const Eigen::Vector3d slam = bearing_from_pixel({static_cast<double>(i), y}, kImageWidth, 50);  // centres at i
      const Eigen::Vector3d ours = bearing_from_pixel({i + 0.5, y}, kImageWidth, 50);
      REQUIRE((turn * slam - ours).norm() < 1e-12);
    }
  }
}
