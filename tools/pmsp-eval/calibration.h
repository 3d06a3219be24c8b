// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "pmsp/types.h"

namespace pmsp::eval {

/// Pixel with estimate and truth.
struct ConfidenceSample {
  float confidence = 0.0F;
  float error = 0.0F;   ///< relative
  float weight = 0.0F;  ///< solid angle, up to a constant factor
};

/// Errors of a decile of confidence; NaN if empty.
struct CalibrationBin {
  double share = 0.0;  ///< of all pixels: 0.1, unless many have equal confidence
  double confidence_min = 0.0;
  double confidence_max = 0.0;
  double expected_error = 0.0;  ///< median of the expected errors
  double error_median = 0.0;
  double error_p90 = 0.0;
  double within = 0.0;  ///< share with an error below Calibration::threshold
};

/// Whether errors fall, or stay, from each decile to the next. Empty deciles are skipped; with fewer than two, all is
/// false.
struct Monotone {
  bool median = false;
  bool p90 = false;
  bool within = false;        ///< rises
  double largest_rise = 0.0;  ///< largest relative rise of median or p90 between deciles; 0 = monotone
};

/// Error over confidence, with pixels weighted equally or by solid angle.
struct CalibrationCurve {
  std::array<CalibrationBin, 10> deciles;  ///< ascending confidence; equal confidences are in one decile
  CalibrationBin confident_half;
  Monotone monotone;
};

struct Calibration {
  std::size_t pixels = 0;
  double threshold = 0.02;
  CalibrationCurve plain;
  CalibrationCurve solid_angle;
};

/// Returns every `stride`-th pixel with an error (not NaN) and a confidence. Both images have the same size.
std::vector<ConfidenceSample> calibration_samples(const Image<float>& error, const Image<float>& confidence,
                                                  std::size_t stride = 1);

/// Sorts `samples`, which must not be empty.
Calibration calibrate(std::vector<ConfidenceSample>& samples);

}  // namespace pmsp::eval
