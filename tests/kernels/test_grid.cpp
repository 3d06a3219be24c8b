// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/helpers.h"
#include "sphere/grid.h"

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
        const std::size_t at = grid.index(x, y);
        REQUIRE(at < seen.size());
        ++seen[at];
        const int colour = (x + y) & 1;
        REQUIRE(at / static_cast<std::size_t>(grid.half()) == static_cast<std::size_t>(2 * y + colour));
        REQUIRE(at == grid.index(y, colour, x / 2));
        REQUIRE(x == 2 * (x / 2) + SphereGrid::first_column(y, colour));
      }
    }
    for (const int count : seen) REQUIRE(count == 1);
  }
}

TEST_CASE("tables: bearings of pixel centres, by column, by colour, and beyond the end by wrapping") {
  for (const auto& size : {std::make_pair(64, 32), {34, 18}}) {
    const SphereGrid grid(size.first, size.second);
    const cpu::GridTables tables = grid.tables();
    CHECK(tables.width == grid.width());
    CHECK(tables.height == grid.height());
    for (int y = 0; y < grid.height(); ++y) {
      for (int x = 0; x < grid.width() + kMaxLanes; ++x) {
        const Vec3<double> truth = frame_at(x % grid.width() + 0.5, y + 0.5, size.first, size.second).bearing;
        const auto bearing =
            k::bearing(tables.sin_lon[2][x], tables.cos_lon[2][x], tables.sin_lat[y], tables.cos_lat[y]);
        REQUIRE(test::length(test::cast<double>(bearing) - truth) < 2e-7);
      }
    }
    for (int parity = 0; parity < 2; ++parity) {
      for (int i = 0; i < grid.half() + kMaxLanes; ++i) {
        const int x = (2 * i + parity) % grid.width();
        REQUIRE(tables.sin_lon[parity][i] == tables.sin_lon[2][x]);
        REQUIRE(tables.cos_lon[parity][i] == tables.cos_lon[2][x]);
      }
    }
  }
}
