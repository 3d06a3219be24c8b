// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "pmsp/types.h"

namespace pmsp::eval {

/// One pixel with an estimate and a truth.
struct ConfidenceSample {
  float confidence = 0.0F;
  float error = 0.0F;   ///< relative
  float weight = 0.0F;  ///< its solid angle, up to a constant factor
};

/// Errors of the pixels of one decile of confidence; NaN where it holds none.
struct CalibrationBin {
  double share = 0.0;  ///< of all pixels: 0.1, unless many have one confidence
  double confidence_min = 0.0;
  double confidence_max = 0.0;
  double error_told = 0.0;  ///< median of what the confidences stand for
  double error_median = 0.0;
  double error_p90 = 0.0;
  double within = 0.0;  ///< share with an error below Calibration::threshold
};

/// Whether errors fall (or stay) from each decile to the next. Deciles without pixels are passed over; with fewer than
/// two left, confidence tells nothing apart, and all is false.
struct Monotone {
  bool median = false;
  bool p90 = false;
  bool within = false;        ///< this one rises
  double largest_rise = 0.0;  ///< of median and p90 from one decile to the next, relative; 0 = both fall everywhere
};

/// How error goes with confidence when each pixel counts the same, or by its solid angle.
struct CalibrationCurve {
  std::array<CalibrationBin, 10> deciles;  ///< ascending confidence; pixels of equal confidence share one
  CalibrationBin confident_half;
  Monotone monotone;
};

struct Calibration {
  std::size_t pixels = 0;
  double threshold = 0.02;
  CalibrationCurve plain;
  CalibrationCurve solid_angle;
};

/// Every `stride`-th pixel that has an error (is not NaN) and a confidence. Both images have the same size.
std::vector<ConfidenceSample> calibration_samples(const Image<float>& error, const Image<float>& confidence,
                                                  std::size_t stride = 1);

/// Sorts `samples`, which must not be empty.
Calibration calibrate(std::vector<ConfidenceSample>& samples);

}  // namespace pmsp::eval
