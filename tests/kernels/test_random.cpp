// SPDX-License-Identifier: BSD-2-Clause
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <set>
#include <vector>

#include "random.h"

namespace k = pmsp::kernels;

namespace {

constexpr std::uint32_t kPixels = 200000;

using Sequence = std::vector<double>;

Sequence sequence(const k::RandomKey& key, const std::function<std::array<std::uint32_t, 2>(std::uint32_t)>& counter) {
  Sequence values;
  values.reserve(kPixels);
  for (std::uint32_t i = 0; i < kPixels; ++i) {
    const std::array<std::uint32_t, 2> at = counter(i);
    values.push_back(k::uniform<double>(key, at[0], at[1]));
  }
  return values;
}

Sequence of_pixels(const k::RandomKey& key, std::uint32_t first_pixel = 0, std::uint32_t draw = 0) {
  return sequence(key, [=](std::uint32_t i) { return std::array<std::uint32_t, 2>{first_pixel + i, draw}; });
}

/// Correlation in units of its standard deviation for independent sequences.
double correlation_sigmas(const Sequence& a, const Sequence& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - 0.5) * (b[i] - 0.5);
  return std::fabs(sum) * 12.0 / std::sqrt(static_cast<double>(a.size()));
}

/// Chi-squared over a grid of `cells` equally likely cells, in standard deviations above its mean.
double excess(const std::vector<double>& counts, double total) {
  const double expected = total / static_cast<double>(counts.size());
  double chi2 = 0.0;
  for (const double count : counts) chi2 += (count - expected) * (count - expected) / expected;
  const double freedom = static_cast<double>(counts.size()) - 1.0;
  return (chi2 - freedom) / std::sqrt(2.0 * freedom);
}

/// Independence beyond linear correlation: pairs over a 16 x 16 grid.
double pair_excess(const Sequence& a, const Sequence& b) {
  std::vector<double> counts(256, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i)
    counts[static_cast<std::size_t>(a[i] * 16) * 16 + static_cast<std::size_t>(b[i] * 16)] += 1.0;
  return excess(counts, static_cast<double>(a.size()));
}

void check_independent(const char* what, const Sequence& a, const Sequence& b) {
  INFO(what);
  CHECK(correlation_sigmas(a, b) < 4.5);
  CHECK(pair_excess(a, b) < 4.5);
}

}  // namespace

TEST_CASE("the draws are the same on every machine and in every version") {
  CHECK(k::mix(1U) == 0x688990c0U);
  CHECK(k::mix(0x12345678U) == 0xf5e71c96U);
  CHECK(k::mix(0xffffffffU) == 0x6768824aU);
  struct Known {
    std::uint64_t seed, keyframe;
    std::uint32_t stage;
    std::array<std::uint32_t, 4> draws;  // times 2^24, of (pixel, draw) = (0, 0), (1, 0), (0, 1), (204799, 31)
  };
  const Known known[] = {
      {1, 0, 1, {1033254, 4964731, 7863989, 16269978}},
      {1, 1, 1, {9305601, 2013635, 4919102, 16317899}},
      {2, 0, 1, {2006095, 8297408, 4066288, 247963}},
      {1, 0, 2, {3020197, 7191411, 3058549, 2179719}},
      {0xdeadbeef12345678ULL, 0xffffffffffffffffULL, 1, {7014684, 9253721, 4797745, 8026155}},
  };
  for (const Known& row : known) {
    const k::RandomKey key = k::random_key(row.seed, row.keyframe, row.stage);
    const auto draw = [&](std::uint32_t pixel, std::uint32_t number) {
      return static_cast<std::uint32_t>(k::uniform<float>(key, pixel, number) * 16777216.0F);
    };
    CHECK(draw(0, 0) == row.draws[0]);
    CHECK(draw(1, 0) == row.draws[1]);
    CHECK(draw(0, 1) == row.draws[2]);
    CHECK(draw(204799, 31) == row.draws[3]);
  }
}

TEST_CASE("draws of all number types are equal multiples of 2^-24 from 0 to less than 1") {
  const k::RandomKey key = k::random_key(7, 21, 1);
  for (std::uint32_t pixel = 0; pixel < 100000; ++pixel) {
    const float value = k::uniform<float>(key, pixel, pixel % 5);
    REQUIRE(value >= 0.0F);
    REQUIRE(value < 1.0F);
    REQUIRE(value * 16777216.0F == std::floor(value * 16777216.0F));
    REQUIRE(static_cast<double>(value) == k::uniform<double>(key, pixel, pixel % 5));
    const float both = k::uniform_signed<float>(key, pixel, pixel % 5);
    REQUIRE(both == 2.0F * value - 1.0F);
  }
}

TEST_CASE("draws are uniform") {
  for (const std::uint64_t seed : {0ULL, 1ULL, 0xffffffffffffffffULL}) {
    const Sequence values = of_pixels(k::random_key(seed, 3, 1), 0, 2);
    double mean = 0.0;
    double square = 0.0;
    std::vector<double> counts(256, 0.0);
    for (const double value : values) {
      mean += value / kPixels;
      square += (value - 0.5) * (value - 0.5) / kPixels;
      counts[static_cast<std::size_t>(value * 256)] += 1.0;
    }
    CHECK(std::fabs(mean - 0.5) < 4.5 * std::sqrt(1.0 / 12.0 / kPixels));
    CHECK(std::fabs(square - 1.0 / 12.0) < 4.5 * std::sqrt(1.0 / 180.0 / kPixels));
    CHECK(std::fabs(excess(counts, kPixels)) < 4.5);
  }
}

TEST_CASE("draws of neighbouring pixels, draws, keyframes, stages and seeds are independent") {
  const k::RandomKey key = k::random_key(1, 10, 1);
  const Sequence base = of_pixels(key);
  check_independent("next pixel", base, of_pixels(key, 1));
  check_independent("pixel below, 640 wide", base, of_pixels(key, 640));
  check_independent("pixel below, 2048 wide", base, of_pixels(key, 2048));
  for (std::uint32_t draw = 1; draw < 9; ++draw) check_independent("later draw", base, of_pixels(key, 0, draw));
  check_independent("next keyframe", base, of_pixels(k::random_key(1, 11, 1)));
  check_independent("keyframe 2^32 later", base, of_pixels(k::random_key(1, 10 + (1ULL << 32U), 1)));
  check_independent("next stage", base, of_pixels(k::random_key(1, 10, 2)));
  check_independent("next seed", base, of_pixels(k::random_key(2, 10, 1)));
  check_independent("seed with another upper half", base, of_pixels(k::random_key(1 + (1ULL << 32U), 10, 1)));
  const Sequence draws = sequence(key, [](std::uint32_t i) { return std::array<std::uint32_t, 2>{5, i}; });
  check_independent("draws against pixels", base, draws);
}

TEST_CASE("no two keyframes, seeds or stages share a key") {
  std::set<std::uint64_t> keys;
  std::size_t wanted = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    for (std::uint64_t keyframe = 0; keyframe < 400; ++keyframe) {
      for (std::uint32_t stage = 0; stage < 3; ++stage) {
        const k::RandomKey key = k::random_key(seed, keyframe, stage);
        keys.insert(static_cast<std::uint64_t>(key.a) << 32U | key.b);
        ++wanted;
      }
    }
  }
  CHECK(keys.size() == wanted);
}
