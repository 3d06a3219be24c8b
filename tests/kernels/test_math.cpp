// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "elementary.h"

namespace k = pmsp::kernels;

namespace {

double atan2_error(float y, float x) {
  return std::fabs(static_cast<double>(k::atan2(y, x)) - std::atan2(static_cast<double>(y), static_cast<double>(x)));
}

}  // namespace

TEST_CASE("exp: relative error over its whole range") {
  constexpr int kSteps = 1000000;
  double worst_float = 0.0;
  double worst_double = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const float x = static_cast<float>(-80.0 + 160.0 * i / kSteps);
    const double truth = std::exp(static_cast<double>(x));
    worst_float = std::max(worst_float, std::fabs(k::exp(x) / truth - 1.0));
    worst_double = std::max(worst_double, std::fabs(k::exp(static_cast<double>(x)) / truth - 1.0));
  }
  INFO("float " << worst_float << ", double " << worst_double);
  CHECK(worst_float < 3e-7);
  CHECK(worst_double < 2e-7);
  CHECK(k::exp(0.0F) == 1.0F);
}

TEST_CASE("exp grows from one float to the next, across the reduction's steps too") {
  for (int n = -100; n <= 100; ++n) {
    float x = static_cast<float>((n + 0.5) * std::log(2.0));
    for (int i = 0; i < 40; ++i) x = std::nextafter(x, -1e9F);
    for (int i = 0; i < 80; ++i) {
      const float next = std::nextafter(x, 1e9F);
      REQUIRE(k::exp(next) >= k::exp(x) * (1.0F - 3e-7F));
      x = next;
    }
  }
}

TEST_CASE("atan_unit: absolute error, of rounding and of the polynomial alone") {
  constexpr int kSteps = 2000000;
  double worst_float = 0.0;
  double worst_double = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const float x = static_cast<float>(i) / static_cast<float>(kSteps);
    const double truth = std::atan(static_cast<double>(x));
    worst_float = std::max(worst_float, std::fabs(k::atan_unit(x) - truth));
    worst_double = std::max(worst_double, std::fabs(k::atan_unit(static_cast<double>(x)) - truth));
  }
  INFO("float " << worst_float << ", double " << worst_double);
  CHECK(worst_float < 2e-7);
  CHECK(worst_double < 2.5e-8);  // the coefficients are floats
}

TEST_CASE("atan2: absolute error in all quadrants, for all lengths") {
  double worst = 0.0;
  for (int i = 0; i < 200000; ++i) {
    const double angle = (i - 100000) * k::kPi / 100000.0;
    for (const double radius : {1.0, 3.7e-20, 8.1e18}) {
      worst = std::max(worst, atan2_error(static_cast<float>(radius * std::sin(angle)),
                                          static_cast<float>(radius * std::cos(angle))));
    }
  }
  INFO("worst " << worst);
  CHECK(worst < 6e-7);
}

TEST_CASE("atan2: axes, diagonals and ratios from tiny to huge") {
  const float pi = static_cast<float>(k::kPi);
  CHECK(k::atan2(0.0F, 0.0F) == 0.0F);
  CHECK(k::atan2(0.0F, 2.0F) == 0.0F);
  CHECK(k::atan2(3.0F, 0.0F) == pi / 2.0F);
  CHECK(k::atan2(-3.0F, 0.0F) == -pi / 2.0F);
  CHECK(k::atan2(0.0F, -5.0F) == pi);
  CHECK(k::atan2(-1e-30F, -5.0F) == -pi);
  double worst = 0.0;
  for (int a = -37; a <= 37; ++a) {
    for (int b = -37; b <= 37; ++b) {
      const float y = std::pow(10.0F, static_cast<float>(a));
      const float x = std::pow(10.0F, static_cast<float>(b));
      for (const float sy : {-1.0F, 1.0F}) {
        for (const float sx : {-1.0F, 1.0F}) worst = std::max(worst, atan2_error(sy * y, sx * x));
      }
    }
  }
  INFO("worst " << worst);
  CHECK(worst < 6e-7);
}

TEST_CASE("atan2 stays between -pi and pi as a float and is relatively exact for small angles") {
  const float pi = static_cast<float>(k::kPi);
  for (int i = 0; i < 30; ++i) {
    const float small = std::ldexp(1.0F, -i);
    CHECK(std::fabs(k::atan2(small, -1.0F)) <= pi);
    CHECK(std::fabs(k::atan2(-small, -1.0F)) <= pi);
    CHECK(k::atan2(small, 1.0F) == Approx(std::atan(static_cast<double>(small))).epsilon(3e-7));
  }
}

TEST_CASE("pow2, whole and to_int") {
  for (int e = -126; e <= 127; ++e) {
    REQUIRE(k::pow2<float>(e) == std::ldexp(1.0F, e));
    REQUIRE(k::pow2<double>(e) == std::ldexp(1.0, e));
  }
  CHECK(k::whole(2.999F) == 2.0F);
  CHECK(k::whole(-0.999F) == 0.0F);
  CHECK(k::to_int(8388607.0F) == 8388607);
}
