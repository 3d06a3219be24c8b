// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "kernels/kernel_helpers.h"
#include "plane_prior.h"
#include "sphere/grid.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
namespace k = pmsp::kernels;

namespace {

const Vec3<float> kAhead{0.0F, 0.0F, 1.0F};
const k::PlaneLimits kLimits{0.01F, 10.0F, 0.0F};

/// The plane z = `distance`.
Vec3<float> wall(float distance) { return {0.0F, 0.0F, 1.0F / distance}; }

/// Supports around the direction ahead, in direction d on the plane z = `distance`(d); 0 = none.
k::NearestSupports around_ahead(const std::function<float(int)>& distance) {
  k::NearestSupports around{};
  for (int d = 0; d < k::kPriorDirections; ++d) {
    const auto angle = static_cast<float>(2.0 * k::kPi * d / k::kPriorDirections);
    around.put(d, distance(d) * Vec3<float>{0.4F * std::cos(angle), 0.4F * std::sin(angle), 1.0F}, 0.005F,
               distance(d) > 0.0F ? 1.0F / 0.03F : 0.0F);
    around.count += distance(d) > 0.0F ? 1 : 0;
  }
  return around;
}

/// Multiplies a support's distance.
void move(k::NearestSupports& around, int d, float factor) {
  around.put(d, factor * around.point(d), around.errors[d], around.inverse_tolerance[d]);
}

/// Distance of the better one of two walls.
float better_wall(float one, float other, const k::NearestSupports& around) {
  k::PriorPlane best{{0.0F, 0.0F, 0.0F}, 0, static_cast<float>(k::kPriorDirections)};
  for (const float distance : {one, other}) k::consider(best, wall(distance), around, kAhead, kLimits);
  return best.supports > 0 ? 1.0F / best.plane.z : 0.0F;
}

k::PriorCells<k::HostViewTypes> cells_with(int columns, int rows, std::vector<k::NearestSupports>& around) {
  k::PriorCells<k::HostViewTypes> cells{};
  cells.limits = kLimits;
  cells.columns = columns;
  cells.rows = rows;
  cells.around = around.data();
  return cells;
}

}  // namespace

TEST_CASE("plane priors: supports in front of a plane contradict it less than supports behind it") {
  const auto seven_of = [](float distance, float others) {
    return around_ahead([=](int d) { return d % 2 == 1 && d < 14 ? distance : others; });
  };
  // Seven lie on the wall, nine on something in front of it, as on a frame around a window.
  CHECK(better_wall(4.0F, 3.0F, seven_of(4.0F, 3.0F)) == Approx(4.0F));
  CHECK(better_wall(3.0F, 4.0F, seven_of(4.0F, 3.0F)) == Approx(4.0F));
  CHECK(better_wall(4.0F, 3.0F, seven_of(3.0F, 4.0F)) == Approx(4.0F));
  // Five are too few against eleven.
  const k::NearestSupports few = around_ahead([](int d) { return d % 3 == 0 && d < 15 ? 4.0F : 3.0F; });
  CHECK(better_wall(4.0F, 3.0F, few) == Approx(3.0F));
}

TEST_CASE("plane priors: a plane is not extended beyond its supports") {
  const auto first = [](int count) { return around_ahead([=](int d) { return d < count ? 4.0F : 0.0F; }); };
  CHECK(better_wall(4.0F, 4.0F, first(16)) == Approx(4.0F));
  CHECK(better_wall(4.0F, 4.0F, first(10)) == Approx(4.0F));
  CHECK(better_wall(4.0F, 4.0F, first(8)) == 0.0F);  // half of the way around is open
  CHECK(k::surround(0x1111U));
  CHECK_FALSE(k::surround(0x8003U));
  CHECK_FALSE(k::surround(0U));
}

TEST_CASE("plane priors: a plane is fitted to the supports near it weighted by their confidence") {
  k::NearestSupports around = around_ahead([](int d) { return d % 4 == 0 ? 4.06F : 4.0F; });
  move(around, 3, 2.0F);  // of another surface
  const float even = 1.0F / k::refitted(around, wall(4.03F)).z;
  CHECK(even > 4.001F);
  CHECK(even < 4.03F);
  for (int d = 0; d < k::kPriorDirections; d += 4) around.errors[d] = 0.05F;
  CHECK(1.0F / k::refitted(around, wall(4.03F)).z == Approx(4.0F).margin(0.002F));
}

TEST_CASE("plane priors: a cell takes the plane of another cell with more inliers also across the seam") {
  constexpr int kColumns = 8;
  constexpr int kRows = 4;
  std::vector<k::NearestSupports> around(kColumns * kRows);
  std::vector<k::PriorPlane> before(kColumns * kRows, {{0.0F, 0.0F, 0.0F}, 0, 16.0F});
  std::vector<k::PriorPlane> found = before;
  k::PriorCells<k::HostViewTypes> cells = cells_with(kColumns, kRows, around);
  cells.previous = before.data();
  cells.found = found.data();
  cells.threads = GENERATE(1, 4, 16);
  std::vector<k::PriorPlane> candidates(static_cast<std::size_t>(cells.threads * kColumns * kRows));
  cells.candidates = candidates.data();
  const auto choose = [&](int column, int row) {
    for (int share = 0; share < cells.threads; ++share) k::try_adopted(cells, column, row, share);
    k::choose_plane(cells, column, row);
  };
  const auto at = [](int column, int row) { return static_cast<std::size_t>(row * kColumns + column); };
  for (const bool backward : {false, true}) {
    const int column = backward ? 0 : 4;
    const int wrapped_pixel = backward ? 7 : 3;
    const float sign = backward ? -1.0F : 1.0F;
    CAPTURE(backward);
    k::NearestSupports& own = around[at(column, 2)];
    own = around_ahead([](int) { return 4.0F; });
    for (float& z : own.z) z *= sign;
    for (const int stride : {1, 2}) {
      cells.stride = stride;
      const int from = backward && stride == 2 ? 6 : wrapped_pixel + 1 - stride;
      before[at(column, 2)] = {{0.0F, 0.0F, 0.0F}, 0, 16.0F};
      before[at(from, 2)] = {{0.0F, 0.0F, sign / 4.05F}, 9, 3.0F};
      choose(column, 2);
      CHECK(found[at(column, 2)].supports == k::kPriorDirections);
      CHECK(found[at(column, 2)].plane.z == Approx(sign / 4.0F).epsilon(1e-3));  // and fits it to its own supports
      before[at(column, 2)] = {{0.0F, 0.0F, sign / 4.0F}, 16, 0.0F};
      choose(column, 2);
      CHECK(found[at(column, 2)].plane.z == sign / 4.0F);  // none is better
      before[at(from, 2)] = {{0.0F, 0.0F, 0.0F}, 0, 16.0F};
    }
  }
}

TEST_CASE("plane priors: the best plane through three supports is found for any number of threads") {
  std::vector<k::NearestSupports> around{
      around_ahead([](int d) { return 3.0F + 0.02F * static_cast<float>(d * 7 % 16); })};
  for (int d = 9; d < 15; ++d) move(around[0], d, 4.0F / around[0].z[d]);
  unsigned char uncertain = 1;
  k::PriorCells<k::HostViewTypes> cells = cells_with(1, 1, around);
  cells.uncertain = &uncertain;
  k::PriorPlane best = k::no_plane();  // by trying all
  const Vec3<float> center = k::cell_bearing(0, 0, 1, 1);
  for (int i = 0; i < k::kPriorDirections; ++i) {
    for (int j = i + 3; j < k::kPriorDirections; ++j) {
      for (int l = j + 3; l < k::kPriorDirections; ++l) {
        if (j - i > 8 || l - j > 8 || i + 16 - l < 3 || i + 16 - l > 8) continue;
        const k::NearestSupports& on = around[0];
        k::consider(best, k::plane_through(on.point(i), on.point(j), on.point(l)), on, center, kLimits);
      }
    }
  }
  REQUIRE(best.supports >= k::kPriorMinSupports);
  for (const int shares : {1, 5, 16}) {
    CAPTURE(shares);
    std::vector<k::PriorPlane> candidates(static_cast<std::size_t>(shares));
    cells.threads = shares;
    cells.candidates = candidates.data();
    for (int share = 0; share < shares; ++share) k::try_planes(cells, 0, 0, share);
    const auto found = std::min_element(candidates.begin(), candidates.end(),
                                        [](const auto& a, const auto& b) { return a.cost < b.cost; });
    CHECK(found->cost == best.cost);
    CHECK(found->supports == best.supports);
  }
}

TEST_CASE("plane priors: given planes are corrected by the supports around unless these contradict each other") {
  constexpr int kColumns = 64;
  constexpr int kRows = 32;
  constexpr int kColumn = 32;
  constexpr int kRow = 16;
  constexpr std::size_t kCell = kRow * kColumns + kColumn;
  std::vector<k::NearestSupports> around(kColumns * kRows);
  std::vector<Vec3<float>> external(kColumns * kRows);
  k::PriorCells<k::HostViewTypes> cells = cells_with(kColumns, kRows, around);
  cells.prior_depth_planes = external.data();
  around[kCell] = around_ahead([](int) { return 4.0F; });
  const auto give = [&](const Vec3<float>& plane) { std::fill(external.begin(), external.end(), plane); };

  give(wall(2.5F));  // the whole image is in another unit
  CHECK(k::corrected_prior_depth(cells, kColumn, kRow).z == Approx(0.25F).epsilon(1e-3));

  give({0.02F, 0.0F, 0.25F});  // turned by some degrees
  const Vec3<float> turned_back = k::corrected_prior_depth(cells, kColumn, kRow);
  CHECK(std::abs(turned_back.x) < 0.007F);
  CHECK(turned_back.z == Approx(0.25F).epsilon(0.01));
  // The plane that lies on the supports, where there are enough of them.
  std::vector<k::PriorPlane> none(kColumns * kRows, {{0.0F, 0.0F, 0.0F}, 0, 16.0F});
  std::vector<k::PriorPlane> found = none;
  cells.previous = none.data();
  cells.found = found.data();
  cells.stride = 1;
  k::choose_plane(cells, kColumn, kRow);
  CHECK(std::abs(found[kCell].plane.x) < 0.001F);
  CHECK(found[kCell].plane.z == Approx(0.25F).epsilon(1e-3));

  give(wall(4.0F));
  for (int d = 0; d < k::kPriorDirections; ++d) {  // a third fits, the others deviate to both sides
    const Vec3<float> support = around[kCell].point(d);
    const float distance = d % 3 == 0 ? 4.0F : d % 3 == 1 ? 2.8F : 6.0F;
    external[static_cast<std::size_t>(k::pixel_index(support, kColumns, kRows))] = wall(distance);
  }
  CHECK_FALSE(k::is_point(k::corrected_prior_depth(cells, kColumn, kRow)));

  give(wall(4.0F));
  external[kCell] = {0.0F, 0.0F, 0.0F};
  CHECK_FALSE(k::is_point(k::corrected_prior_depth(cells, kColumn, kRow)));
}

TEST_CASE("plane priors: a plane that agrees with a given one is fitted to all supports near it") {
  constexpr int kColumns = 64;
  constexpr int kRows = 32;
  std::vector<k::NearestSupports> around(kColumns * kRows);
  const k::PriorCells<k::HostViewTypes> cells = cells_with(kColumns, kRows, around);
  around[16 * kColumns + 32] = around_ahead([](int d) { return d % 4 == 0 ? 4.06F : 4.0F; });
  const Vec3<float> plane = k::agreeing_plane(cells, 32, 16, wall(4.1F));
  CHECK(1.0F / plane.z > 4.001F);  // twelve of them lie on 4 exactly
  CHECK(1.0F / plane.z < 4.03F);
}

TEST_CASE("plane priors: pixels around a support are found across the seam") {
  constexpr int kWidth = 32;
  constexpr int kHeight = 16;
  const SphereGrid grid(kWidth, kHeight);
  std::vector<float> x(kWidth * kHeight, 0.0F), z(kWidth * kHeight, 0.0F);
  k::PriorCells<k::HostViewTypes> cells{};
  cells.grid = grid.view();
  cells.map = {x.data(), x.data(), z.data(), kWidth, kHeight, nullptr};
  const Vec3<float> behind{0.0F, 0.0F, -0.25F};
  for (const int column : {0, 1, kWidth - 2, kWidth - 1}) {
    CAPTURE(column);
    std::fill(z.begin(), z.end(), -0.25F);
    CHECK(k::neighbours_on_plane(cells, column, 8, behind) == 8);
    const int beyond = column < 2 ? column - 2 + kWidth : column + 2 - kWidth;
    for (int row = 6; row <= 10; row += 2) z[static_cast<std::size_t>(row * kWidth + beyond)] = -0.5F;
    CHECK(k::neighbours_on_plane(cells, column, 8, behind) == 5);
  }
}

TEST_CASE("plane priors: only pixels without evidence of depth in the image have one") {
  constexpr int kSide = 8;  // of a map of one cell
  const std::vector<float> x(kSide * kSide, 0.0F);
  const std::vector<float> score(kSide * kSide, 0.9F);
  std::vector<float> z;
  const SphereGrid grid(kSide, kSide);
  for (int i = 0; i < kSide * kSide; ++i) {
    z.push_back(k::bearing_at<float>(grid.view(), i % kSide, i / kSide).z > 0.0F ? 0.25F : -0.25F);
  }
  std::vector<float> variance(kSide * kSide, 100.0F);
  std::vector<float> certainty(kSide * kSide, 1e6F);
  std::vector<k::PriorPlane> found{{wall(4.0F), 9, 0.0F}};
  k::PriorCells<k::HostViewTypes> cells{};
  cells.map = {x.data(), x.data(), z.data(), kSide, kSide, score.data()};
  cells.grid = grid.view();
  cells.spacing = 0.01F;
  cells.variance = variance.data();
  cells.certainty = certainty.data();
  cells.min_variance = 4.0F;
  cells.columns = cells.rows = 1;
  cells.found = found.data();
  variance[3 * kSide + 3] = 1.0F;    // no texture
  certainty[4 * kSide + 4] = 1e-3F;  // none that determines depth
  z[3 * kSide + 4] = 0.0F;           // no plane to begin with
  variance[3 * kSide + 4] = 1.0F;
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      CAPTURE(column, row);
      const bool uncertain = (column == 3 && row == 3) || (column == 4 && row == 4);
      CHECK(k::prior_at(cells, column, row).z == (uncertain ? 0.25F : 0.0F));
    }
  }
}
