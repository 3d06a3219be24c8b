// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "cpu/executor_impl.h"
#include "kernels/helpers.h"
#include "pmsp/error.h"
#include "sphere/grid.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
using pmsp::test::cast;
using pmsp::test::Draws;
using pmsp::test::frame_at;
namespace k = pmsp::kernels;

namespace {

/// The instruction sets of this machine besides the scalar one.
std::vector<Simd> sets_to_compare() {
  std::vector<Simd> sets;
  for (const Simd simd : {Simd::kAvx2, Simd::kAvx512}) {
    try {
      Executor(1, simd);
      sets.push_back(simd);
    } catch (const BackendUnavailable&) {
      WARN("not compared, since this machine lacks it: " << name_of(simd));
    }
  }
  return sets;
}

// Neither width is a multiple of 8 or 16 lanes in all of its rows' parts.
const std::vector<std::pair<int, int>> kSizes = {{64, 32}, {34, 18}, {50, 26}, {10, 6}, {102, 52}};

constexpr float kUntouched = -77.0F;
constexpr std::size_t kGuard = 16;

std::vector<float> medians(Simd simd, const std::vector<float>& depth, const std::vector<float>& score, int width,
                           int height) {
  const Executor executor(1, simd);
  std::vector<float> filtered(depth.size() + kGuard, kUntouched);
  const cpu::MedianJob job{width, height, depth.data(), score.data(), 0.05F, 0.1F, filtered.data()};
  for (int y = 0; y < height; ++y) executor.impl().rows.median_row(job, y);
  return filtered;
}

/// The same by the definition: neighbours beyond a pole lie on the opposite meridian, x wraps.
float median_at(const std::vector<float>& depth, const std::vector<float>& score, int width, int height, int x, int y) {
  const auto at = [&](int column, int row) {
    if (row < 0 || row >= height) {
      row = y;
      column += width / 2;
    }
    return depth[static_cast<std::size_t>(row * width + (column + width) % width)];
  };
  const float own = at(x, y);
  std::vector<float> around;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) around.push_back(at(x + dx, y + dy) > 0.0F ? at(x + dx, y + dy) : own);
  }
  std::sort(around.begin(), around.end());
  const bool near = std::fabs(own - around[4]) <= 0.05F * around[4];
  return near && score[static_cast<std::size_t>(y * width + x)] >= 0.1F ? own : 0.0F;
}

struct Comparison {
  std::vector<float> closeness, implied_depth, parallax_gain;
  std::vector<std::int32_t> index;
};

/// Two maps of a bumpy sphere, some pixels without an estimate.
struct CompareInput {
  CompareInput(int width, int height, std::uint64_t seed)
      : grid(width, height), depth(grid.size()), x(grid.size()), y(grid.size()), z(grid.size()) {
    Draws draws(seed);
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        const auto at = static_cast<std::size_t>(row * width + column);
        const Vec3<double> bearing = frame_at(column + 0.5, row + 0.5, width, height).bearing;
        depth[at] =
            draws.uniform() < 0.1 ? 0.0F : static_cast<float>(2.0 + 0.4 * bearing.x + draws.uniform(-0.05, 0.05));
        const Vec3<double> plane = (0.5 - 0.1 * bearing.x) * (bearing + 0.2 * draws.direction());
        if (draws.uniform() < 0.1) continue;  // no estimate
        x[at] = static_cast<float>(plane.x);
        y[at] = static_cast<float>(plane.y);
        z[at] = static_cast<float>(plane.z);
      }
    }
    other_from_first = to_rigid(draws.transform(1.0, 0.4));
  }

  SphereGrid grid;
  std::vector<float> depth, x, y, z;
  k::Rigid other_from_first{};
};

Comparison compare(Simd simd, const CompareInput& input) {
  const Executor executor(1, simd);
  const std::size_t width = static_cast<std::size_t>(input.grid.width());
  const std::size_t size = input.grid.size() + kGuard;
  Comparison out{std::vector<float>(size, kUntouched), std::vector<float>(size, kUntouched),
                 std::vector<float>(size, kUntouched), std::vector<std::int32_t>(size, -77)};
  const k::PlaneMapView other{input.x.data(), input.y.data(), input.z.data(), input.grid.width(), input.grid.height()};
  const cpu::CompareJob job{input.grid.tables(), input.depth.data(), other, input.other_from_first};
  for (int y = 0; y < input.grid.height(); ++y) {
    const std::size_t at = static_cast<std::size_t>(y) * width;
    executor.impl().rows.compare_row(
        job, y, {&out.closeness[at], &out.implied_depth[at], &out.parallax_gain[at], &out.index[at]});
  }
  return out;
}

bool close(float a, float b, double relative) {
  return std::fabs(static_cast<double>(a) - b) <= relative * std::max(1.0, std::fabs(static_cast<double>(b)));
}

}  // namespace

TEST_CASE("median filter rows: the definition at every pixel, equal on all instruction sets, nothing beyond the row") {
  std::vector<Simd> sets = sets_to_compare();
  sets.push_back(Simd::kScalar);
  for (const auto& size : kSizes) {
    const int width = size.first;
    const int height = size.second;
    Draws draws(static_cast<std::uint64_t>(width));
    std::vector<float> depth(static_cast<std::size_t>(width * height));
    std::vector<float> score(depth.size());
    for (std::size_t i = 0; i < depth.size(); ++i) {
      depth[i] = draws.uniform() < 0.2 ? 0.0F : static_cast<float>(draws.uniform(2.0, 2.3));
      score[i] = static_cast<float>(draws.uniform(0.0, 1.0));
    }
    for (const Simd simd : sets) {
      INFO(name_of(simd) << ", " << width << " x " << height);
      const std::vector<float> filtered = medians(simd, depth, score, width, height);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          REQUIRE(filtered[static_cast<std::size_t>(y * width + x)] == median_at(depth, score, width, height, x, y));
        }
      }
      REQUIRE(std::count(filtered.end() - kGuard, filtered.end(), kUntouched) == kGuard);
    }
  }
}

TEST_CASE("comparison rows: the kernel at every pixel, in scalar") {
  const CompareInput input(50, 26, 3);
  const Comparison rows = compare(Simd::kScalar, input);
  const k::PlaneMapView other{input.x.data(), input.y.data(), input.z.data(), 50, 26};
  int known = 0;
  int agreeing = 0;
  for (int y = 0; y < 26; ++y) {
    for (int x = 0; x < 50; ++x) {
      const auto at = static_cast<std::size_t>(y * 50 + x);
      if (input.depth[at] <= 0.0F) {
        REQUIRE(rows.closeness[at] == 0.0F);
        continue;
      }
      ++known;
      const Vec3<double> bearing = frame_at(x + 0.5, y + 0.5, 50, 26).bearing;
      const auto truth = k::agreement(bearing, static_cast<double>(input.depth[at]), other, input.other_from_first);
      if (truth.index != rows.index[at]) continue;
      ++agreeing;
      REQUIRE(rows.closeness[at] == Approx(truth.closeness).epsilon(1e-4));
      REQUIRE(rows.implied_depth[at] == Approx(truth.implied_depth).epsilon(1e-4));
      REQUIRE(rows.parallax_gain[at] == Approx(truth.parallax_gain).epsilon(1e-4));
    }
  }
  CHECK(known > 1000);
  CHECK(agreeing > known - 5);
}

TEST_CASE("comparison rows: all instruction sets agree with scalar, nothing beyond the row") {
  for (const Simd simd : sets_to_compare()) {
    for (const auto& size : kSizes) {
      INFO(name_of(simd) << ", " << size.first << " x " << size.second);
      const CompareInput input(size.first, size.second, 4);
      const Comparison scalar = compare(Simd::kScalar, input);
      const Comparison wide = compare(simd, input);
      int other_pixel = 0;  // points on the border of two pixels
      int positive = 0;
      for (std::size_t i = 0; i < input.grid.size(); ++i) {
        if (scalar.index[i] != wide.index[i]) {
          ++other_pixel;
          continue;
        }
        if (scalar.closeness[i] > 0.0F) ++positive;
        REQUIRE(close(wide.closeness[i], scalar.closeness[i], 1e-4));
        REQUIRE(close(wide.implied_depth[i], scalar.implied_depth[i], 1e-4));
      }
      CHECK(other_pixel <= 2 + static_cast<int>(input.grid.size() / 1000));
      CHECK(positive > static_cast<int>(input.grid.size() / 2));
      for (std::size_t i = input.grid.size(); i < scalar.index.size(); ++i) {
        REQUIRE(wide.closeness[i] == kUntouched);
        REQUIRE(wide.implied_depth[i] == kUntouched);
        REQUIRE(wide.index[i] == -77);
      }
    }
  }
}
