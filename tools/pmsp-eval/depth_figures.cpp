// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/depth_figures.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pmsp::eval {

void DepthFigureSums::add_range(double estimate, double truth, double weight) {
  constexpr double kDelta = 1.25;
  const double error = estimate - truth;
  const double ratio = std::max(estimate / truth, truth / estimate);
  weight_ += weight;
  sums_.abs_rel += weight * std::abs(error) / truth;
  sums_.sq_rel += weight * error * error / truth;
  sums_.rmse += weight * error * error;
  sums_.log10 += weight * std::abs(std::log10(estimate / truth));
  if (ratio < kDelta) sums_.delta_1 += weight;
  if (ratio < kDelta * kDelta) sums_.delta_2 += weight;
  if (ratio < kDelta * kDelta * kDelta) sums_.delta_3 += weight;
}

void DepthFigureSums::add_normal(float angle_deg, double weight) { angles_.push_back({angle_deg, weight}); }

DepthFigures DepthFigureSums::result() const {
  DepthFigures result = sums_;
  for (const DepthFigure& figure : kDepthFigures) result.*figure.value = std::numeric_limits<double>::quiet_NaN();
  if (weight_ > 0.0) {
    for (std::size_t i = 0; i < kRangeFigures; ++i) {
      double DepthFigures::*const value = kDepthFigures[i].value;
      result.*value = sums_.*value / weight_;
    }
    result.rmse = std::sqrt(result.rmse);
  }
  if (angles_.empty()) return result;
  std::vector<Angle> sorted = angles_;
  std::sort(sorted.begin(), sorted.end(), [](const Angle& a, const Angle& b) { return a.degrees < b.degrees; });
  double weight = 0.0;
  for (const Angle& angle : sorted) weight += angle.weight;
  double sum = 0.0, weighted = 0.0;
  result.normal_11_25 = result.normal_22_5 = result.normal_30 = 0.0;
  for (const Angle& angle : sorted) {
    const double degrees = static_cast<double>(angle.degrees);
    sum += angle.weight;
    weighted += angle.weight * degrees;
    if (std::isnan(result.normal_median_deg) && sum >= 0.5 * weight) result.normal_median_deg = degrees;
    if (degrees < 11.25) result.normal_11_25 += angle.weight;
    if (degrees < 22.5) result.normal_22_5 += angle.weight;
    if (degrees < 30.0) result.normal_30 += angle.weight;
  }
  result.normal_mean_deg = weighted / weight;
  result.normal_11_25 /= weight;
  result.normal_22_5 /= weight;
  result.normal_30 /= weight;
  return result;
}

}  // namespace pmsp::eval
