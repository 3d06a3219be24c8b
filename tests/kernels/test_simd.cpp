// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "cpu/executor_impl.h"
#include "kernels/kernel_helpers.h"
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

/// A map in memory with something behind its end.
struct GuardedMap {
  explicit GuardedMap(std::size_t size) : x(size + kGuard, kUntouched), y(x), z(x), score(x) {}

  k::PlaneArrays arrays() { return {x.data(), y.data(), z.data(), score.data()}; }

  std::vector<float> x, y, z, score;
};

template <class Stage>
void run_rows(Simd simd, const Stage& stage) {
  const Executor executor(1, simd);
  impl_of(executor).run(stage);
}

/// Whether the median filter keeps each pixel: 1 or 0, and the memory behind them.
std::vector<float> medians(Simd simd, const std::vector<float>& depth, const std::vector<float>& score, int width,
                           int height) {
  const SphereGrid grid(width, height);
  std::vector<float> x(depth.size());
  std::vector<float> y(depth.size());
  std::vector<float> z(depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (!(depth[i] > 0.0F)) continue;
    const Vec3<float> plane =
        (1.0F / depth[i]) *
        k::bearing_at(grid.view(), k::single_pixel(static_cast<int>(i) % width, static_cast<int>(i) / width, width));
    x[i] = plane.x;
    y[i] = plane.y;
    z[i] = plane.z;
  }
  GuardedMap filtered(depth.size());
  run_rows(simd, k::MedianFilter<k::HostViewTypes>{{x.data(), y.data(), z.data(), width, height, score.data()},
                                                   grid.view(),
                                                   {nullptr},
                                                   true,
                                                   0.05F,
                                                   0.1F,
                                                   filtered.arrays()});
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const bool kept = filtered.x[i] == x[i] && filtered.y[i] == y[i] && filtered.z[i] == z[i] && x[i] != 0.0F;
    const bool dropped = filtered.x[i] == 0.0F && filtered.y[i] == 0.0F && filtered.z[i] == 0.0F;
    REQUIRE((kept || dropped));
    REQUIRE(filtered.score[i] == (kept ? score[i] : 0.0F));
    filtered.x[i] = kept ? 1.0F : 0.0F;
  }
  for (std::size_t i = depth.size(); i < filtered.x.size(); ++i) {
    REQUIRE((filtered.y[i] == kUntouched && filtered.z[i] == kUntouched && filtered.score[i] == kUntouched));
  }
  return filtered.x;
}

/// The same by the definition: neighbours beyond a pole lie on the opposite meridian, x wraps.
bool median_at(const std::vector<float>& depth, const std::vector<float>& score, int width, int height, int x, int y) {
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
  return own > 0.0F && near && score[static_cast<std::size_t>(y * width + x)] >= 0.1F;
}

/// Two maps of a bumpy sphere, some pixels without an estimate.
struct CompareInput {
  CompareInput(int width, int height, std::uint64_t seed)
      : grid(width, height), score(grid.size(), 0.9F), x(grid.size()), y(grid.size()), z(grid.size()) {
    for (std::vector<float>& coordinate : own) coordinate.resize(grid.size());
    Draws draws(seed);
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        const auto at = static_cast<std::size_t>(row * width + column);
        const Vec3<double> bearing = frame_at(column + 0.5, row + 0.5, width, height).bearing;
        if (draws.uniform() >= 0.1) {
          const double inverse_depth = 1.0 / (2.0 + 0.4 * bearing.x + draws.uniform(-0.05, 0.05));
          own[0][at] = static_cast<float>(inverse_depth * bearing.x);
          own[1][at] = static_cast<float>(inverse_depth * bearing.y);
          own[2][at] = static_cast<float>(inverse_depth * bearing.z);
        }
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
  std::vector<float> own[3];  ///< planes of the first map
  std::vector<float> score, x, y, z;
  k::Rigid other_from_first{};
};

/// Confidences after the consistency filter, and the memory behind them.
std::vector<float> compare(Simd simd, const CompareInput& input) {
  const k::PlaneMapView own{input.own[0].data(), input.own[1].data(), input.own[2].data(),
                            input.grid.width(),  input.grid.height(), input.score.data()};
  const k::PlaneMapView other{input.x.data(),     input.y.data(),      input.z.data(),
                              input.grid.width(), input.grid.height(), input.score.data()};
  std::vector<float> confidence(input.grid.size() + kGuard, kUntouched);
  k::ConsistencyFilter<k::HostViewTypes> stage{};
  stage.map = own;
  stage.grid = input.grid.view();
  stage.others[0] = {other, input.other_from_first};
  stage.count = 1;
  stage.min_agreeing = 1;
  stage.tolerance = 0.5F;
  stage.confidence = confidence.data();
  run_rows(simd, stage);
  return confidence;
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
      depth[i] = draws.uniform() < 0.2
                     ? 0.0F
                     : 2.003F + 0.01F * std::floor(30.0F * static_cast<float>(draws.uniform()));  // none at a limit
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

TEST_CASE("consistency filter rows: all instruction sets agree with scalar, nothing beyond the end") {
  for (const Simd simd : sets_to_compare()) {
    for (const auto& size : kSizes) {
      INFO(name_of(simd) << ", " << size.first << " x " << size.second);
      const CompareInput input(size.first, size.second, 4);
      const std::vector<float> scalar = compare(Simd::kScalar, input);
      const std::vector<float> wide = compare(simd, input);
      int elsewhere = 0;  // points on the border of two pixels
      int positive = 0;
      for (std::size_t i = 0; i < input.grid.size(); ++i) {
        elsewhere += close(wide[i], scalar[i], 1e-4) ? 0 : 1;
        positive += scalar[i] > 0.0F ? 1 : 0;
      }
      CHECK(elsewhere <= 2 + static_cast<int>(input.grid.size() / 1000));
      CHECK(positive > static_cast<int>(input.grid.size() / 2));
      for (std::size_t i = input.grid.size(); i < wide.size(); ++i) REQUIRE(wide[i] == kUntouched);
    }
  }
}
