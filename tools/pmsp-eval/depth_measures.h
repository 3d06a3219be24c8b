// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/depth_figures.h"
#include "pmsp/types.h"

namespace pmsp::eval {

struct DepthMeasureOptions {
  double scale = 1.0;                                 ///< metres per unit of the depth map, > 0
  std::vector<double> relative = {0.01, 0.02, 0.05};  ///< of the true range, > 0
  int slack_px = 0;                                   ///< see true_ranges
};

/// Shares, 0 to 1, of all pixels with a true range, unless stated otherwise; NaN without any.
struct DepthMeasures {
  struct Within {
    double threshold = 0.0;
    double share = 0.0;  ///< with a relative error below the threshold
    double share_solid_angle = 0.0;
    double of_valid = 0.0;  ///< as `share`, of pixels with an estimate; NaN without any
  };
  double valid = 0.0;  ///< with an estimate
  double valid_solid_angle = 0.0;
  std::vector<Within> within;
  double error_median = 0.0;  ///< relative, over pixels with an estimate; NaN without any
  double error_p90 = 0.0;
  DepthFigures plain;        ///< every pixel counts the same
  DepthFigures solid_angle;  ///< pixels count by their solid angle
};

/// `depth`: any size, `truth`: [m]. `error`: set to the relative error, NaN where depth or truth is unknown.
DepthMeasures measure_depth(const Image<float>& depth, const Image<float>& truth,
                            const DepthMeasureOptions& options = {}, Image<float>* error = nullptr);

/// Sets the figures of normals. Both images hold unit normals in the camera's frame, in any size; (0, 0, 0) = unknown.
void measure_normals(const Image<Eigen::Vector3f>& normals, const Image<Eigen::Vector3f>& truth,
                     DepthMeasures& measures);

/// Returns the scale of a depth map by itself [m per unit]: median ratio of true range and depth; nullopt without a
/// pixel with both.
std::optional<double> own_scale(const Image<float>& depth, const Image<float>& truth);

/// Returns the mean of each measure over all depth maps; undefined values are skipped. `maps` must not be empty.
DepthMeasures mean_of(const std::vector<DepthMeasures>& maps);

}  // namespace pmsp::eval
