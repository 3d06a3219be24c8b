// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "elementary.h"
#include "eval/eval_flight.h"
#include "pmsp-eval/calibration.h"
#include "pmsp-eval/calibration_plot.h"
#include "pmsp-eval/depth_files.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"

using namespace pmsp::eval;
using pmsp::Image;
using pmsp_test::TempDir;

namespace {

/// Ten groups of 20 pixels with confidences near 0.05, 0.15, ...: half of each group has the error `errors[i]`, a
/// fifth of it three times as much, the rest nearly none. Shuffled.
std::vector<ConfidenceSample> groups(const std::vector<double>& errors) {
  std::vector<ConfidenceSample> samples;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    for (int k = 0; k < 20; ++k) {
      const float confidence = 0.1F * static_cast<float>(i) + 0.004F * static_cast<float>(k);
      const double factor = k < 6 ? 0.01 : k < 16 ? 1.0 : 3.0;
      samples.push_back({confidence, static_cast<float>(factor * errors[i]), 1.0F});
    }
  }
  std::shuffle(samples.begin(), samples.end(), std::mt19937(7));
  return samples;
}

const std::vector<double> kFalling = {0.1, 0.09, 0.08, 0.07, 0.06, 0.05, 0.019, 0.006, 0.003, 0.002};

}  // namespace

TEST_CASE("deciles of a known distribution have its quantiles") {
  auto samples = groups(kFalling);
  const Calibration c = calibrate(samples);
  CHECK(c.pixels == 200);
  for (std::size_t i = 0; i < 10; ++i) {
    INFO("decile " << i + 1);
    const CalibrationBin& bin = c.plain.deciles[i];
    CHECK(bin.share == Approx(0.1));
    CHECK(bin.confidence_min == Approx(0.1 * static_cast<double>(i)).margin(1e-6));
    CHECK(bin.confidence_max == Approx(0.1 * static_cast<double>(i) + 0.076));
    CHECK(bin.expected_error == Approx(0.005 * (1.0 / (0.1 * static_cast<double>(i) + 0.036) - 1.0)).epsilon(1e-3));
    CHECK(bin.error_median == Approx(kFalling[i]));
    CHECK(bin.error_p90 == Approx(3.0 * kFalling[i]));
    CHECK(bin.within == Approx(i < 6 ? 0.3 : i == 6 ? 0.8 : 1.0));
    CHECK(c.solid_angle.deciles[i].error_median == bin.error_median);  // all weigh the same
  }
  const CalibrationBin& half = c.plain.confident_half;
  CHECK(half.share == Approx(0.5));
  CHECK(half.confidence_min == Approx(0.5));
  CHECK(half.error_median == Approx(0.003));
  CHECK(half.within == Approx((0.3 + 0.8 + 3.0) / 5.0));
}

TEST_CASE("the verdict states whether errors fall and the largest rise") {
  auto falling = groups(kFalling);
  const Monotone good = calibrate(falling).plain.monotone;
  CHECK(good.median);
  CHECK(good.p90);
  CHECK(good.within);
  CHECK(good.largest_rise == 0.0);

  auto errors = kFalling;
  errors[4] = 1.25 * errors[3];
  auto bumpy = groups(errors);
  const Monotone bump = calibrate(bumpy).plain.monotone;
  CHECK_FALSE(bump.median);
  CHECK_FALSE(bump.p90);
  CHECK(bump.within);  // 0.3 on both sides of the bump
  CHECK(bump.largest_rise == Approx(0.25));

  std::reverse(errors.begin(), errors.end());
  auto rising = groups(errors);
  CHECK_FALSE(calibrate(rising).plain.monotone.within);

  auto equal = groups(std::vector<double>(10, 0.01));
  const Monotone flat = calibrate(equal).plain.monotone;
  CHECK(flat.median);
  CHECK(flat.largest_rise == 0.0);
}

TEST_CASE("pixels of equal confidence share a decile") {
  std::vector<ConfidenceSample> samples;
  for (int i = 0; i < 100; ++i) {  // 30 at 0, 50 at 0.5, 20 at 1
    const float confidence = i < 30 ? 0.0F : i < 80 ? 0.5F : 1.0F;
    samples.push_back({confidence, 0.01F * (2.0F - confidence), 1.0F});
  }
  const Calibration c = calibrate(samples);
  double shares[10] = {};
  shares[1] = 0.3;  // each where its middle lies: 0.15, 0.55, 0.9
  shares[5] = 0.5;
  shares[9] = 0.2;
  for (std::size_t i = 0; i < 10; ++i) {
    INFO("decile " << i + 1);
    CHECK(c.plain.deciles[i].share == Approx(shares[i]));
    CHECK(std::isnan(c.plain.deciles[i].error_median) == (shares[i] == 0.0));
  }
  CHECK(c.plain.monotone.median);
  CHECK(c.plain.confident_half.share == Approx(0.7));
}

TEST_CASE("a confidence that is the same everywhere is not monotone") {
  std::vector<ConfidenceSample> samples(50, ConfidenceSample{0.7F, 0.01F, 1.0F});
  const Calibration c = calibrate(samples);
  CHECK_FALSE(c.plain.monotone.median);
  CHECK_FALSE(c.plain.monotone.p90);
  CHECK_FALSE(c.plain.monotone.within);
  CHECK(c.plain.confident_half.share == Approx(1.0));
}

TEST_CASE("errors near the poles count by their solid angle") {
  constexpr int kHeight = 180;
  Image<float> error(2 * kHeight, kHeight, 0.01F);
  for (int y = 0; y < 20; ++y) {  // latitudes beyond 70 degrees: 22 % of the pixels, 6 % of the sphere
    for (int x = 0; x < 2 * kHeight; ++x) error(x, y) = error(x, kHeight - 1 - y) = 0.1F;
  }
  auto samples = calibration_samples(error, Image<float>(2 * kHeight, kHeight, 0.5F));
  const Calibration c = calibrate(samples);
  CHECK(c.plain.confident_half.within == Approx(7.0 / 9.0));
  CHECK(c.plain.confident_half.error_p90 == Approx(0.1));
  CHECK(c.solid_angle.confident_half.within == Approx(std::sin(70.0 / 180.0 * pmsp::kernels::kPi)).epsilon(1e-4));
  CHECK(c.solid_angle.confident_half.error_p90 == Approx(0.01));
}

TEST_CASE("pixels without error or confidence are skipped and large maps can be thinned") {
  Image<float> error(8, 4, 0.01F);
  Image<float> confidence(8, 4, 0.5F);
  error(3, 1) = std::numeric_limits<float>::quiet_NaN();
  confidence(4, 1) = std::numeric_limits<float>::quiet_NaN();
  CHECK(calibration_samples(error, confidence).size() == 30);
  CHECK(calibration_samples(error, confidence, 3).size() == 10);  // 11 less pixel 12
}

TEST_CASE("a confidence lies beside its depth map") {
  const TempDir folder;
  pmsp::write_pfm(folder / "confidence_000042.pfm", Image<float>(8, 4, 0.25F));
  CHECK(load_confidence(folder / "depth_000042.pfm", 8, 4)(7, 3) == 0.25F);
  CHECK(load_confidence(folder / "depth_000042.png", 8, 4)(0, 0) == 0.25F);
  CHECK(load_confidence(folder / "depth_000043.pfm", 8, 4).empty());
  CHECK(load_confidence(folder / "estimate.pfm", 8, 4).empty());
  CHECK_THROWS_WITH(load_confidence(folder / "depth_000042.pfm", 16, 8), Catch::Contains("16 x 8"));
}

TEST_CASE("errors of zero and a single decile can be drawn") {
  const TempDir folder;
  std::vector<ConfidenceSample> samples(50, ConfidenceSample{0.7F, 0.0F, 1.0F});
  write_calibration_plot(folder / "plot.png", calibrate(samples));
  CHECK(pmsp_test::read_text(folder / "plot.png").substr(0, 4) == "\x89PNG");
  CHECK(folder.entries() == 1);
}
