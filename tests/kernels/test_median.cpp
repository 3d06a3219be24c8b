// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <vector>

#include "kernels/kernel_helpers.h"
#include "median.h"

using pmsp::test::Draws;
namespace k = pmsp::kernels;

namespace {

using Nine = std::array<float, 9>;

float sorted_median(Nine values) {
  std::sort(values.begin(), values.end());
  return values[4];
}

float network_median(Nine values) { return k::median9(values.data()); }

float filtered(Nine around, float score, float max_deviation = 0.05F, float min_score = 0.1F) {
  return k::median_filtered(around.data(), score, max_deviation, min_score);
}

}  // namespace

TEST_CASE("median9 is the median: all orders of zeros and ones, which proves it for all values") {
  for (unsigned bits = 0; bits < 512; ++bits) {  // the 0-1 principle of comparison networks
    Nine values{};
    for (unsigned i = 0; i < 9; ++i) values[i] = (bits >> i & 1U) != 0 ? 1.0F : 0.0F;
    REQUIRE(network_median(values) == sorted_median(values));
  }
}

TEST_CASE("median9 against sorting, with zeros, ties and negative numbers") {
  Draws draws(1);
  for (int i = 0; i < 50000; ++i) {
    Nine values{};
    for (float& value : values) {
      const double kind = draws.uniform();
      value = kind < 0.2   ? 0.0F
              : kind < 0.5 ? static_cast<float>(draws.below(4))
                           : static_cast<float>(draws.gaussian());
    }
    REQUIRE(network_median(values) == sorted_median(values));
  }
}

TEST_CASE("median filter: a depth near the median of its neighbourhood stays and one far from it is dropped") {
  const auto around = [](float own) { return Nine{2.0F, 2.02F, 1.98F, 2.01F, own, 1.99F, 2.0F, 2.0F, 2.03F}; };
  CHECK(filtered(around(2.0F), 0.9F) == 2.0F);
  CHECK(filtered(around(2.09F), 0.9F) == 2.09F);
  CHECK(filtered(around(1.91F), 0.9F) == 1.91F);
  CHECK(filtered(around(2.12F), 0.9F) == 0.0F);
  CHECK(filtered(around(1.88F), 0.9F) == 0.0F);
  CHECK(filtered(around(2.12F), 0.9F, 0.10F) == 2.12F);
}

TEST_CASE("median filter: a score below the minimum is dropped for any depth") {
  const Nine flat{1, 1, 1, 1, 1, 1, 1, 1, 1};
  CHECK(filtered(flat, 0.1F) == 1.0F);
  CHECK(filtered(flat, 0.0999F) == 0.0F);
  CHECK(filtered(flat, -1.0F) == 0.0F);
  CHECK(filtered(flat, -1.0F, 0.05F, -1.0F) == 1.0F);
}

TEST_CASE("median filter: missing neighbours count as the pixel's own depth and a missing pixel stays missing") {
  CHECK(filtered({0, 0, 0, 0, 3.0F, 0, 0, 0, 0}, 0.9F) == 3.0F);
  CHECK(filtered({9, 9, 9, 9, 3.0F, 0, 0, 0, 0}, 0.9F) == 3.0F);  // 4 against 5
  CHECK(filtered({9, 9, 9, 9, 3.0F, 9, 0, 0, 0}, 0.9F) == 0.0F);
  CHECK(filtered({2, 2, 2, 2, 0.0F, 2, 2, 2, 2}, 0.9F) == 0.0F);
  CHECK(filtered({0, 0, 0, 0, 0.0F, 0, 0, 0, 0}, 0.9F) == 0.0F);
}

TEST_CASE("median filter does not depend on the unit of length") {
  Draws draws(2);
  int kept = 0;
  for (int i = 0; i < 5000; ++i) {
    Nine values{};
    Nine scaled{};
    for (std::size_t n = 0; n < 9; ++n) {
      values[n] = draws.uniform() < 0.1 ? 0.0F : static_cast<float>(draws.uniform(1.9, 2.2));
      scaled[n] = 1024.0F * values[n];
    }
    const float result = filtered(values, 0.5F);
    REQUIRE(filtered(scaled, 0.5F) == 1024.0F * result);
    if (result > 0.0F) ++kept;
  }
  CHECK(kept > 1000);
  CHECK(kept < 4900);
}
