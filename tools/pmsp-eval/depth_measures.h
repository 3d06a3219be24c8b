// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "pmsp/types.h"

namespace pmsp::eval {

struct DepthMeasureOptions {
  double scale = 1.0;                                 ///< metres per unit of the depth map, > 0
  std::vector<double> relative = {0.01, 0.02, 0.05};  ///< of the true range, > 0
  int slack_px = 0;                                   ///< see relative_error
};

/// Shares, 0 to 1, are of all pixels with a true range, unless said otherwise.
struct DepthMeasures {
  struct Within {
    double threshold = 0.0;
    double share = 0.0;  ///< with an estimate whose relative error is below the threshold
    double share_solid_angle = 0.0;
    double of_valid = 0.0;  ///< the same, of the pixels with an estimate
  };
  double valid = 0.0;  ///< with an estimate
  double valid_solid_angle = 0.0;
  std::vector<Within> within;
  double error_median = 0.0;  ///< relative, over pixels with an estimate; NaN without any
  double error_p90 = 0.0;
};

/// `depth` of any size, `truth` [m]. Where `error` is given it receives the relative error, NaN where depth or truth
/// are unknown.
DepthMeasures measure_depth(const Image<float>& depth, const Image<float>& truth,
                            const DepthMeasureOptions& options = {}, Image<float>* error = nullptr);

/// Metres per unit of a depth map by itself: the median of its pixels' true ranges over their depths. Throws
/// InvalidInput where no pixel has both.
double own_scale(const Image<float>& depth, const Image<float>& truth);

/// Each figure's mean over all depth maps; medians without a value are left out. `maps` must not be empty.
DepthMeasures mean_of(const std::vector<DepthMeasures>& maps);

}  // namespace pmsp::eval
