// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "fusion_weight.h"
#include "kernels/kernel_helpers.h"
#include "resample.h"
#include "sphere/grid.h"
#include "stage.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
using pmsp::test::frame_at;
namespace k = pmsp::kernels;

TEST_CASE("checkerboard order: every index once, colours in one piece per row") {
  for (const auto& size : {std::make_pair(2, 2), {6, 4}, {10, 6}, {64, 32}, {34, 18}}) {
    const SphereGrid grid(size.first, size.second);
    REQUIRE(grid.size() == static_cast<std::size_t>(size.first * size.second));
    std::vector<int> seen(grid.size(), 0);
    for (int y = 0; y < grid.height(); ++y) {
      for (int x = 0; x < grid.width(); ++x) {
        const std::size_t at = k::checkerboard_index(grid.width(), x, y);
        REQUIRE(at < seen.size());
        ++seen[at];
        const int colour = (x + y) & 1;
        REQUIRE(at / static_cast<std::size_t>(grid.width() / 2) == static_cast<std::size_t>(2 * y + colour));
        REQUIRE(at == k::ring_index(grid.width(), y, colour) + static_cast<std::size_t>(x / 2));
        REQUIRE(x == 2 * (x / 2) + ((y + colour) & 1));
      }
    }
    for (const int count : seen) REQUIRE(count == 1);
  }
}

TEST_CASE("tables: bearings of pixel centres") {
  for (const auto& size : {std::make_pair(64, 32), {34, 18}}) {
    const SphereGrid grid(size.first, size.second);
    const k::GridView tables = grid.view();
    CHECK(tables.width == grid.width());
    CHECK(tables.height == grid.height());
    for (int y = 0; y < grid.height(); ++y) {
      for (int x = 0; x < grid.width(); ++x) {
        const Vec3<double> truth = frame_at(x + 0.5, y + 0.5, size.first, size.second).bearing;
        const auto bearing = k::bearing_at(tables, k::single_pixel(x, y, grid.width()));
        REQUIRE(test::length(test::cast<double>(bearing) - truth) < 2e-7);
      }
    }
  }
}

TEST_CASE("pixels beside another one: around the seam, and over the poles on the opposite meridian") {
  const SphereGrid grid(16, 8);
  const auto index = [&](int x, int y, int dx, int dy) {
    return k::wrapped_index(grid.view(), k::single_pixel(x, y, 16), dx, dy);
  };
  CHECK(index(3, 4, 2, -3) == 1 * 16 + 5);
  CHECK(index(15, 4, 3, 0) == 4 * 16 + 2);
  CHECK(index(0, 4, -3, 0) == 4 * 16 + 13);
  CHECK(index(3, 0, 1, -1) == 0 * 16 + 12);
  CHECK(index(3, 7, 0, 2) == 6 * 16 + 11);
  CHECK(index(15, 0, 1, -2) == 1 * 16 + 8);
}

TEST_CASE("pixels within a distance of an image point are each found once, across the seam and near the poles too") {
  constexpr int kWidth = 64;
  constexpr int kHeight = 32;
  const SphereGrid grid(kWidth, kHeight);
  const float* const cos_lat = grid.view().cos_lat;
  for (const k::Pixel<float>& at :
       {k::Pixel<float>{20.3F, 16.4F}, {0.2F, 14.7F}, {63.9F, 17.1F}, {31.5F, 2.6F}, {0.6F, 30.9F}, {63.2F, 0.3F}}) {
    for (const float spacing : {0.4F, 1.3F, 2.5F}) {
      CAPTURE(at.x, at.y, spacing);
      std::multiset<int> expected;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const float dy = static_cast<float>(y) + 0.5F - at.y;
          const float apart = std::abs(static_cast<float>(x) + 0.5F - at.x);
          const float dx = std::min(apart, static_cast<float>(kWidth) - apart) * cos_lat[y];
          if (dx * dx + dy * dy <= spacing * spacing && dx <= (0.5F * kWidth - 1.0F) * cos_lat[y]) {
            expected.insert(y * kWidth + x);
          }
        }
      }
      std::multiset<int> found;
      k::for_each_within(at, spacing, cos_lat, kWidth, kHeight, [&](int pixel) { found.insert(pixel); });
      CHECK(found == expected);
    }
  }
}

TEST_CASE("values around an image: from the other side of the seam, from the opposite meridian beyond a pole") {
  std::vector<float> values(16 * 8);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
  const k::GrayView image{values.data(), 16, 8};
  const auto value = [&](int x, int y) { return values[static_cast<std::size_t>(y * 16 + x)]; };
  CHECK(k::pixel_around(image, 3, 5) == value(3, 5));
  CHECK(k::pixel_around(image, -1, 5) == value(15, 5));
  CHECK(k::pixel_around(image, 17, 5) == value(1, 5));
  CHECK(k::pixel_around(image, 3, -1) == value(11, 0));
  CHECK(k::pixel_around(image, 12, 9) == value(4, 6));
}
