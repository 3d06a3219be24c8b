// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <cmath>
#include <limits>

#include "elementary.h"
#include "pmsp-eval/depth_measures.h"
#include "pmsp-eval/image_compare.h"
#include "pmsp/error.h"

using namespace pmsp::eval;
using pmsp::Image;
using pmsp::InvalidInput;

namespace {

constexpr int kWidth = 80;
constexpr int kHeight = 40;

Image<float> truth() { return Image<float>(kWidth, kHeight, 2.0F); }

}  // namespace

TEST_CASE("known errors give exact shares") {
  // Eight stripes of ten columns: errors 0.4, 0.4, 1.5, 3, 4, 10 %, and two without an estimate.
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float factors[8] = {1.004F, 0.996F, 1.015F, 0.97F, 1.04F, 1.1F, 0.0F, nan};
  Image<float> depth(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) depth(x, y) = 4.0F * factors[x / 10];
  }
  DepthMeasureOptions options;
  options.scale = 0.5;
  Image<float> error;
  const DepthMeasures m = measure_depth(depth, truth(), options, &error);
  CHECK(m.valid == Approx(6.0 / 8.0));
  CHECK(m.valid_solid_angle == Approx(6.0 / 8.0));
  REQUIRE(m.within.size() == 3);
  const double expected[3] = {2.0, 3.0, 5.0};
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(m.within[i].share == Approx(expected[i] / 8.0));
    CHECK(m.within[i].share_solid_angle == Approx(expected[i] / 8.0));
    CHECK(m.within[i].of_valid == Approx(expected[i] / 6.0));
  }
  CHECK(m.error_median == Approx((0.015 + 0.03) / 2.0).epsilon(1e-4));
  CHECK(m.error_p90 == Approx(0.1).epsilon(1e-4));
  CHECK(error(55, 3) == Approx(0.1).epsilon(1e-4));
  CHECK(std::isnan(error(65, 3)));
  CHECK(std::isnan(error(75, 3)));
}

TEST_CASE("negative and infinite depths are no estimates") {
  Image<float> depth(kWidth, kHeight, 2.0F);
  depth(0, 0) = -2.0F;
  depth(1, 0) = std::numeric_limits<float>::infinity();
  const DepthMeasures m = measure_depth(depth, truth());
  CHECK(m.valid == Approx(1.0 - 2.0 / (kWidth * kHeight)));
  CHECK(m.error_p90 == 0.0);
}

TEST_CASE("a hole at the pole counts by its solid angle in depth maps") {
  Image<float> depth(180, 90, 2.0F);
  for (int y = 0; y < 15; ++y) {  // latitudes above 60 degrees
    for (int x = 0; x < 180; ++x) depth(x, y) = 0.0F;
  }
  const DepthMeasures m = measure_depth(depth, Image<float>(360, 180, 2.0F));
  CHECK(m.valid == Approx(5.0 / 6.0));
  CHECK(m.within[0].share == Approx(5.0 / 6.0));
  CHECK(m.valid_solid_angle == Approx((1.0 + std::sin(60.0 / 180.0 * pmsp::kernels::kPi)) / 2.0).epsilon(1e-4));
  CHECK(m.within[0].share_solid_angle == Approx(m.valid_solid_angle));
}

TEST_CASE("only pixels with a truth count") {
  Image<float> known = truth();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) known(x, y) = 0.0F;
  }
  Image<float> depth(kWidth, kHeight, 2.0F);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < 3 * kWidth / 4; ++x) depth(x, y) = 0.0F;
  }
  const DepthMeasures m = measure_depth(depth, known);
  CHECK(m.valid == Approx(0.5));
  CHECK(m.within[0].share == Approx(0.5));
  CHECK(m.within[0].of_valid == 1.0);
}

TEST_CASE("a depth map without any estimate has no error") {
  const DepthMeasures m = measure_depth(Image<float>(kWidth, kHeight), truth());
  CHECK(m.valid == 0.0);
  CHECK(m.within[2].of_valid == 0.0);
  CHECK(std::isnan(m.error_median));
  const DepthMeasures good = measure_depth(truth(), truth());
  const DepthMeasures mean = mean_of({m, good});
  CHECK(mean.valid == Approx(0.5));
  CHECK(mean.within[0].share == Approx(0.5));
  CHECK(mean.error_median == 0.0);  // of the one map that has one
}

TEST_CASE("slack takes the best true value nearby, across the seam") {
  Image<float> known(8, 4, 2.0F);
  known(7, 1) = 3.0F;
  Image<float> estimate(8, 4, 2.0F);
  estimate(0, 1) = 3.0F;
  CHECK(relative_error(estimate, known, 0)(0, 1) == Approx(0.5F));
  CHECK(relative_error(estimate, known, 1)(0, 1) == 0.0F);
  CHECK(relative_error(estimate, known, 1)(7, 1) == 0.0F);
  CHECK(relative_error(estimate, known, 0)(7, 1) == Approx(1.0F / 3.0F));
}

TEST_CASE("the truth of a pixel is the value at its centre") {
  Image<float> known(12, 6);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 12; ++x) known(x, y) = static_cast<float>(1 + x + 12 * y);
  }
  const Image<float> estimate(4, 2, 1.0F);  // three pixels of the truth for each: the middle one
  const Image<float> error = relative_error(estimate, known, 0);
  CHECK(error(1, 1) == Approx((known(4, 4) - 1.0F) / known(4, 4)));
}

TEST_CASE("a depth map's own scale is that of most of its pixels") {
  Image<float> depth = truth();
  for (float& value : depth.pixels()) value *= 0.5F;
  CHECK(own_scale(depth, truth()) == Approx(2.0));
  for (int x = 0; x < kWidth; ++x) depth(x, 0) = 100.0F;  // far off
  for (int x = 0; x < kWidth; ++x) depth(x, 1) = 0.0F;    // unknown
  CHECK(own_scale(depth, truth()) == Approx(2.0));
  CHECK_THROWS_AS(own_scale(Image<float>(kWidth, kHeight), truth()), InvalidInput);
}

TEST_CASE("the truth is interpolated on a surface and taken from the nearest pixel at an edge") {
  // Inverse range grows evenly from column to column, but for an edge and a hole.
  Image<float> known(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) known(x, y) = 1.0F / (0.2F + 0.001F * static_cast<float>(x));
    known(40, y) = 1.0F;
    known(60, y) = 0.0F;
  }
  CHECK(range_at(known, 10.5, 20.5) == Approx(1.0 / 0.210));
  CHECK(range_at(known, 10.75, 20.1) == Approx(1.0 / 0.21025));
  CHECK(range_at(known, 10.75, 0.0) == Approx(1.0 / 0.21025));
  CHECK(range_at(known, 40.1, 20.0) == 1.0F);
  CHECK(range_at(known, 39.9, 20.0) == Approx(1.0 / 0.239));
  CHECK(range_at(known, 60.1, 20.0) == 0.0F);
  CHECK(range_at(known, kWidth - 0.1, 20.0) == known(kWidth - 1, 20));  // beside an edge at the seam
  CHECK(range_at(known, 0.1, 20.0) == known(0, 20));
  Image<float> estimate(kWidth / 4 * 3, kHeight / 4 * 3);  // centres lie between those of the truth
  for (int y = 0; y < estimate.height(); ++y) {
    for (int x = 0; x < estimate.width(); ++x) {
      estimate(x, y) = 1.0F / (0.2F + 0.001F * ((static_cast<float>(x) + 0.5F) * 4.0F / 3.0F - 0.5F));
    }
  }
  const Image<float> error = relative_error(estimate, known, 0);
  for (int x = 1; x < 29; ++x) CHECK(error(x, 10) < 1e-5F);
}
