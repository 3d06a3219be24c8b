// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/helpers.h"
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
        const auto bearing = k::bearing_at(tables, k::place_of(x, y, grid.width()));
        REQUIRE(test::length(test::cast<double>(bearing) - truth) < 2e-7);
      }
    }
  }
}

TEST_CASE("pixels beside another one: around the seam, and over the poles on the opposite meridian") {
  const SphereGrid grid(16, 8);
  const auto index = [&](int x, int y, int dx, int dy) {
    return k::index_beside(grid.view(), k::place_of(x, y, 16), dx, dy);
  };
  CHECK(index(3, 4, 2, -3) == 1 * 16 + 5);
  CHECK(index(15, 4, 3, 0) == 4 * 16 + 2);
  CHECK(index(0, 4, -3, 0) == 4 * 16 + 13);
  CHECK(index(3, 0, 1, -1) == 0 * 16 + 12);
  CHECK(index(3, 7, 0, 2) == 6 * 16 + 11);
  CHECK(index(15, 0, 1, -2) == 1 * 16 + 8);
}
