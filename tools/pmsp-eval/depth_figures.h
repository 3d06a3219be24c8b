// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace pmsp::eval {

/// Figures that publications on depth estimation report, of the pixels with an estimate and a truth; NaN without any.
struct DepthFigures {
  double abs_rel = 0.0;  ///< mean of |d - t| / t
  double sq_rel = 0.0;   ///< mean of (d - t)^2 / t [m]
  double rmse = 0.0;     ///< root mean square of d - t [m]
  double log10 = 0.0;    ///< mean of |log10 d - log10 t|
  double delta_1 = 0.0;  ///< share with max(d / t, t / d) < 1.25
  double delta_2 = 0.0;  ///< below 1.25^2
  double delta_3 = 0.0;  ///< below 1.25^3
  // Angles between estimated and true normals, of the pixels with both.
  double normal_mean_deg = 0.0;
  double normal_median_deg = 0.0;
  double normal_11_25 = 0.0;  ///< share below 11.25 degrees
  double normal_22_5 = 0.0;   ///< below 22.5 degrees
  double normal_30 = 0.0;     ///< below 30 degrees
};

struct DepthFigure {
  const char* name;  ///< JSON key
  double DepthFigures::*value;
};

/// All figures, in the order of reports: first those of ranges, then those of normals.
constexpr std::array<DepthFigure, 12> kDepthFigures{{{"abs_rel", &DepthFigures::abs_rel},
                                                     {"sq_rel", &DepthFigures::sq_rel},
                                                     {"rmse", &DepthFigures::rmse},
                                                     {"log10", &DepthFigures::log10},
                                                     {"delta_1", &DepthFigures::delta_1},
                                                     {"delta_2", &DepthFigures::delta_2},
                                                     {"delta_3", &DepthFigures::delta_3},
                                                     {"normal_mean_deg", &DepthFigures::normal_mean_deg},
                                                     {"normal_median_deg", &DepthFigures::normal_median_deg},
                                                     {"normal_11_25", &DepthFigures::normal_11_25},
                                                     {"normal_22_5", &DepthFigures::normal_22_5},
                                                     {"normal_30", &DepthFigures::normal_30}}};

constexpr std::size_t kRangeFigures = 7;

/// Accumulates weighted pixels.
class DepthFigureSums {
 public:
  /// `estimate`, `truth`: ranges [m], > 0.
  void add_range(double estimate, double truth, double weight);
  /// `angle_deg`: between estimated and true normal.
  void add_normal(float angle_deg, double weight);

  DepthFigures result() const;

 private:
  struct Angle {
    float degrees;
    double weight;
  };

  double weight_ = 0.0;
  DepthFigures sums_;
  std::vector<Angle> angles_;
};

}  // namespace pmsp::eval
