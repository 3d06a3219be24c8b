// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cpu/cpu_processor.h"
#include "fusion/mirrors.h"
#include "kernels/kernel_helpers.h"
#include "sphere/grid.h"
#include "wide_plane.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
namespace k = pmsp::kernels;

namespace {

constexpr int kWidth = 256;
constexpr int kHeight = 128;

/// Points of the walls of a box around the camera, axes along its own.
std::vector<std::uint32_t> inside_box(const k::GridView& grid, const Vec3<float>& half_size) {
  std::vector<std::uint32_t> surfels;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vec3<float> ray = k::bearing_at<float>(grid, x, y);
      const Vec3<float> share{std::abs(ray.x) / half_size.x, std::abs(ray.y) / half_size.y,
                              std::abs(ray.z) / half_size.z};
      const float nearest = std::max({share.x, share.y, share.z});
      Vec3<float> normal{0.0F, 0.0F, 0.0F};
      (nearest == share.x ? normal.x : nearest == share.y ? normal.y : normal.z) = 1.0F;
      surfels.push_back(k::pack_point<float>(1.0F / nearest, normal, {0.0F, 0.0F, 0.0F}, 1.0F).surfel);
    }
  }
  return surfels;
}

std::vector<k::WidePlane> found_in(const std::vector<std::uint32_t>& surfels) {
  const Executor executor(1);
  const CpuProcessor on(executor, kWidth, kHeight);
  const Array<k::WidePlane> found = wide_planes(on, surfels.data());
  return {found.get(), found.get() + k::kTiles};
}

}  // namespace

TEST_CASE("wide planes: each side of a cube covers a sixth of the sphere also at the poles") {
  const SphereGrid grid(kWidth, kHeight);
  int upward = 0;
  int level = 0;
  for (const k::WidePlane& each : found_in(inside_box(grid.view(), {2.0F, 2.0F, 2.0F}))) {
    if (each.support < 0.1F) continue;  // of a field that two sides meet in
    const Vec3<double> plane = test::cast<double>(each.plane);
    CHECK(test::length(plane) == Approx(0.5).epsilon(0.02));
    CHECK(each.support == Approx(1.0 / 6.0).margin(0.015));
    ++(std::abs(plane.y) > 0.4 ? upward : level);
  }
  CHECK(upward > 20);
  CHECK(level > 20);
}

TEST_CASE("wide planes: the widest sides of a long room are each chosen once") {
  const SphereGrid grid(kWidth, kHeight);
  // Floor and ceiling take most of the sphere, then the long walls.
  const std::vector<k::WidePlane> found = found_in(inside_box(grid.view(), {2.0F, 1.0F, 6.0F}));
  k::WidePlane chosen[k::kWidePlanes];
  k::ChooseWidePlanes{found.data(), chosen}(k::single_pixel(0, 0, 1), nullptr);
  for (int m = 1; m < k::kWidePlanes; ++m) CHECK(chosen[m].support <= chosen[m - 1].support);
  std::vector<double> sides;  // y of the first two, x of the others
  for (int m = 0; m < k::kWidePlanes; ++m) {
    REQUIRE(k::is_plane(chosen[m]));
    sides.push_back(static_cast<double>(m < 2 ? chosen[m].plane.y : chosen[m].plane.x));
  }
  std::sort(sides.begin(), sides.end());
  const double expected[] = {-1.0, -0.5, 0.5, 1.0};
  for (std::size_t i = 0; i < sides.size(); ++i) CHECK(sides[i] == Approx(expected[i]).epsilon(0.02));
}

TEST_CASE("wide planes: a table is not the floor below it") {
  std::vector<k::WidePlane> found(k::kTiles);
  found[3] = {{0.0F, 1.0F / 2.0F, 0.0F}, 0.2F};
  found[4] = {{0.0F, 1.0F / 2.1F, 0.0F}, 0.15F};  // the floor again, as another field has it
  found[9] = {{0.0F, 1.0F / 1.2F, 0.0F}, 0.1F};
  k::WidePlane chosen[k::kWidePlanes];
  k::ChooseWidePlanes{found.data(), chosen}(k::single_pixel(0, 0, 1), nullptr);
  CHECK(chosen[0].plane.y == found[3].plane.y);
  CHECK(chosen[1].plane.y == found[9].plane.y);
  CHECK_FALSE(k::is_plane(chosen[2]));
}
