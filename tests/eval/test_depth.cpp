// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "elementary.h"
#include "pmsp-eval/depth_measures.h"
#include "pmsp-eval/image_compare.h"

using namespace pmsp::eval;
using pmsp::Image;

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
  CHECK(std::isnan(m.within[2].of_valid));
  CHECK(std::isnan(m.error_median));
  const DepthMeasures good = measure_depth(truth(), truth());
  const DepthMeasures unknown = measure_depth(truth(), Image<float>(kWidth, kHeight));  // no truth
  CHECK(std::isnan(unknown.valid));
  const DepthMeasures mean = mean_of({m, good, unknown});
  CHECK(mean.valid == Approx(0.5));
  CHECK(mean.valid_solid_angle == Approx(0.5));
  CHECK(mean.within[0].share == Approx(0.5));
  CHECK(mean.within[0].share_solid_angle == Approx(0.5));
  CHECK(mean.within[0].of_valid == 1.0);  // of the one map that has one
  CHECK(mean.error_median == 0.0);
}

TEST_CASE("published figures are those computed by hand") {
  // Four pixels of one row: d / t = 1, 1.2 (t = 2), 1.5 (t = 4), 1 / 2 (t = 1); a second row without estimates.
  Image<float> known(4, 2, 1.0F), depth(4, 2, 0.0F);
  const float t[4] = {1.0F, 2.0F, 4.0F, 1.0F}, d[4] = {1.0F, 2.4F, 6.0F, 0.5F};
  std::copy(t, t + 4, known.row(0));
  std::copy(d, d + 4, depth.row(0));
  const DepthMeasures m = measure_depth(depth, known);
  for (const DepthFigures* figures : {&m.plain, &m.solid_angle}) {  // all weights are equal
    CHECK(figures->abs_rel == Approx((0.0 + 0.2 + 0.5 + 0.5) / 4.0).epsilon(1e-6));
    CHECK(figures->sq_rel == Approx((0.0 + 0.16 / 2.0 + 4.0 / 4.0 + 0.25) / 4.0).epsilon(1e-6));
    CHECK(figures->rmse == Approx(std::sqrt((0.16 + 4.0 + 0.25) / 4.0)).epsilon(1e-6));
    CHECK(figures->log10 == Approx((std::log10(1.2) + std::log10(1.5) + std::log10(2.0)) / 4.0).epsilon(1e-6));
    CHECK(figures->delta_1 == 0.5);   // 1, 1.2
    CHECK(figures->delta_2 == 0.75);  // 1.5 < 1.5625
    CHECK(figures->delta_3 == 0.75);  // 2 > 1.953
    CHECK(std::isnan(figures->normal_mean_deg));
    CHECK(std::isnan(figures->normal_30));
  }
  CHECK(m.valid == 0.5);
}

TEST_CASE("published figures by solid angle weigh rows by the cosine of their latitude") {
  // Rows at latitudes 67.5, 22.5, -22.5, -67.5 degrees with errors of 10, 20, 30, 40 % at 2 m.
  Image<float> depth(8, 4);
  for (int y = 0; y < 4; ++y) std::fill_n(depth.row(y), 8, 2.0F * (1.1F + 0.1F * static_cast<float>(y)));
  const DepthMeasures m = measure_depth(depth, Image<float>(8, 4, 2.0F));
  const double near = std::cos(22.5 * pmsp::kernels::kDegree), far = std::cos(67.5 * pmsp::kernels::kDegree);
  const double total = 2.0 * (near + far);
  CHECK(m.plain.abs_rel == Approx(0.25).epsilon(1e-6));
  CHECK(m.solid_angle.abs_rel == Approx((0.5 * far + 0.5 * near) / total).epsilon(1e-6));
  CHECK(m.solid_angle.sq_rel == Approx(2.0 * ((0.01 + 0.16) * far + (0.04 + 0.09) * near) / total).epsilon(1e-6));
  CHECK(m.solid_angle.rmse ==
        Approx(2.0 * std::sqrt(((0.01 + 0.16) * far + (0.04 + 0.09) * near) / total)).epsilon(1e-6));
  CHECK(m.solid_angle.log10 ==
        Approx(((std::log10(1.1) + std::log10(1.4)) * far + (std::log10(1.2) + std::log10(1.3)) * near) / total)
            .epsilon(1e-6));
  CHECK(m.plain.delta_1 == 0.5);
  CHECK(m.solid_angle.delta_1 == Approx(0.5));
  CHECK(m.plain.delta_2 == 1.0);
}

TEST_CASE("errors of normals are angles, plain and by solid angle") {
  const auto tilted = [](double degrees) {
    const double a = degrees * pmsp::kernels::kDegree;
    return Eigen::Vector3f(static_cast<float>(std::sin(a)), 0.0F, static_cast<float>(-std::cos(a)));
  };
  // Rows by latitude: 10, 20, 25 and 90 degrees off; one pixel of each is unknown on either side.
  const double angles[4] = {10.0, 20.0, 25.0, 90.0};
  Image<Eigen::Vector3f> normals(8, 4, tilted(0.0)), known = normals;
  for (int y = 0; y < 4; ++y) {
    std::fill_n(normals.row(y), 8, tilted(angles[y]));
    normals(2, y) = Eigen::Vector3f::Zero();
    known(5, y) = Eigen::Vector3f::Zero();
  }
  DepthMeasures m = measure_depth(Image<float>(8, 4, 2.0F), Image<float>(8, 4, 2.0F));
  measure_normals(normals, known, m);
  const double near = std::cos(22.5 * pmsp::kernels::kDegree), far = std::cos(67.5 * pmsp::kernels::kDegree);
  const double total = 2.0 * (near + far);
  CHECK(m.plain.normal_mean_deg == Approx((10.0 + 20.0 + 25.0 + 90.0) / 4.0).epsilon(1e-5));
  CHECK(m.plain.normal_median_deg == Approx(20.0).epsilon(1e-5));
  CHECK(m.plain.normal_11_25 == Approx(0.25));
  CHECK(m.plain.normal_22_5 == Approx(0.5));
  CHECK(m.plain.normal_30 == Approx(0.75));
  CHECK(m.solid_angle.normal_mean_deg == Approx((100.0 * far + 45.0 * near) / total).epsilon(1e-5));
  CHECK(m.solid_angle.normal_11_25 == Approx(far / total));
  CHECK(m.solid_angle.normal_22_5 == Approx((far + near) / total));
  CHECK(m.solid_angle.normal_30 == Approx((far + 2.0 * near) / total));
  CHECK(m.plain.abs_rel == 0.0);  // kept
  measure_normals({}, known, m);
  CHECK(std::isnan(m.plain.normal_median_deg));
}

TEST_CASE("the mean of published figures skips depth maps without them") {
  Image<float> depth(4, 2, 1.0F);
  depth(0, 0) = 1.5F;
  const DepthMeasures half = measure_depth(depth, Image<float>(4, 2, 1.0F));
  const DepthMeasures none = measure_depth(Image<float>(4, 2), Image<float>(4, 2, 1.0F));
  CHECK(std::isnan(none.plain.abs_rel));
  CHECK(std::isnan(none.solid_angle.delta_1));
  const DepthMeasures mean = mean_of({half, none, half});
  CHECK(mean.plain.abs_rel == half.plain.abs_rel);
  CHECK(mean.solid_angle.rmse == half.solid_angle.rmse);
  CHECK(std::isnan(mean.plain.normal_mean_deg));
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
  CHECK(own_scale(depth, truth()).value() == Approx(2.0));
  for (int x = 0; x < kWidth; ++x) depth(x, 0) = 100.0F;  // far off
  for (int x = 0; x < kWidth; ++x) depth(x, 1) = 0.0F;    // unknown
  CHECK(own_scale(depth, truth()).value() == Approx(2.0));
  CHECK_FALSE(own_scale(Image<float>(kWidth, kHeight), truth()));
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
