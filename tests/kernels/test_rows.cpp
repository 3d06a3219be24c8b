// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <utility>
#include <vector>

#include "cpu/rows.h"
#include "sphere/grid.h"

using namespace pmsp;

namespace {

using Batch = xsimd::batch<float, xsimd::default_arch>;
constexpr int kLanes = cpu::lanes<Batch>();

int modulo(int a, int n) { return ((a % n) + n) % n; }

struct RowPixels {
  int x, y;
};

/// Where the neighbour at an offset lies by geometry: beyond a pole on the opposite meridian.
RowPixels expected_place(int x, int y, int width, int height, const kernels::NeighbourOffset& offset) {
  int row = y + offset.dy;
  int column = x + offset.dx;
  if (row < 0 || row >= height) {
    row = row < 0 ? -1 - row : 2 * height - 1 - row;
    column += width / 2;
  }
  return {modulo(column, width), row};
}

void check_neighbours(int width, int height) {
  const int half = width / 2;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int colour = (x + y) & 1;
      for (int i = 0; i < kernels::kNeighbourOffsets; ++i) {
        const kernels::NeighbourOffset offset = kernels::neighbour_offset(i);
        const kernels::NeighbourRing from = kernels::neighbour_ring(width, height, y, colour, offset.dx, offset.dy);
        INFO("size " << width << " x " << height << ", pixel " << x << ", " << y << ", offset " << offset.dx << ", "
                     << offset.dy);
        REQUIRE(from.y >= 0);
        REQUIRE(from.y < height);
        const int k = x / 2 + from.shift;
        REQUIRE(k > -half);  // what load_ring takes
        const int column = 2 * modulo(k, half) + ((from.y + 1 - colour) & 1);
        const RowPixels place = expected_place(x, y, width, height, offset);
        REQUIRE(((column + from.y) & 1) == 1 - colour);
        REQUIRE(from.y == place.y);
        const int distance = modulo(column - place.x, width);
        const bool beyond_pole = y + offset.dy < 0 || y + offset.dy >= height;
        REQUIRE((distance == 0 || (beyond_pole && distance == 1)));
      }
    }
  }
}

}  // namespace

TEST_CASE("neighbour offsets: eight distinct and symmetric ones of the other colour") {
  int sum_x = 0;
  int sum_y = 0;
  for (int i = 0; i < kernels::kNeighbourOffsets; ++i) {
    const kernels::NeighbourOffset a = kernels::neighbour_offset(i);
    CHECK(((a.dx + a.dy) & 1) != 0);
    sum_x += a.dx;
    sum_y += a.dy;
    for (int j = 0; j < i; ++j) {
      const kernels::NeighbourOffset b = kernels::neighbour_offset(j);
      CHECK((a.dx != b.dx || a.dy != b.dy));
    }
  }
  CHECK(sum_x == 0);
  CHECK(sum_y == 0);
}

TEST_CASE("neighbours follow the geometry at the seam and beyond the poles for even and odd half widths") {
  const std::vector<std::pair<int, int>> sizes = {{6, 4},   {6, 6},   {8, 4},   {10, 6},  {14, 8},  {16, 16},
                                                  {22, 10}, {32, 16}, {34, 18}, {64, 32}, {66, 34}, {130, 66}};
  for (const auto& size : sizes) {
    check_neighbours(size.first, size.second);
  }
}

TEST_CASE("load_ring wraps for every start, ring and number of lanes") {
  for (int count = 1; count <= 3 * kLanes; ++count) {
    std::vector<float> ring(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) ring[static_cast<std::size_t>(i)] = static_cast<float>(i);
    for (int first = 1 - count; first <= 3 * count; ++first) {
      REQUIRE(kernels::load_ring<float>(ring.data(), first, count) == static_cast<float>(modulo(first, count)));
      float lanes[kLanes];
      kernels::load_ring<Batch>(ring.data(), first, count).store_unaligned(lanes);
      for (int lane = 0; lane < kLanes; ++lane) {
        INFO("ring of " << count << ", start " << first << ", lane " << lane);
        REQUIRE(lanes[lane] == static_cast<float>(modulo(first + lane, count)));
      }
    }
  }
}

TEST_CASE("store writes the first lanes and nothing else") {
  float numbers[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) numbers[lane] = static_cast<float>(lane + 1);
  const Batch value = Batch::load_unaligned(numbers);
  for (int count = 0; count <= 2 * kLanes; ++count) {
    std::vector<float> memory(3 * kLanes, -1.0F);
    kernels::store<Batch>(value, memory.data(), count);
    for (int i = 0; i < 3 * kLanes; ++i) {
      REQUIRE(memory[static_cast<std::size_t>(i)] == (i < std::min(count, kLanes) ? static_cast<float>(i + 1) : -1.0F));
    }
  }
  float one[2] = {-1.0F, -1.0F};
  kernels::store<float>(5.0F, one, 3);
  CHECK(one[0] == 5.0F);
  CHECK(one[1] == -1.0F);
}

TEST_CASE("bytes: gathered, and stored with gaps") {
  std::vector<std::uint8_t> bytes(100);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(200 - i);
  const auto columns = cpu::columns_from<Batch>(10, 12 + kLanes);
  const auto gathered = kernels::gather_bytes<Batch>(bytes.data(), columns);
  std::uint8_t stored[3 * kLanes] = {};
  kernels::store_bytes<Batch>(gathered, stored, 2, kLanes - 1);
  for (int i = 0; i < kLanes - 1; ++i) {
    CHECK(stored[2 * i] == 190 - i);
    CHECK(stored[2 * i + 1] == 0);
  }
  CHECK(stored[2 * (kLanes - 1)] == 0);
}
