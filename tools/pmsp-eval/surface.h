// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/ground_truth.h"

namespace pmsp::eval {

struct SurfaceOptions {
  double voxel_m = 0.01;      ///< one sample is kept in each cube of this size [m], > 0
  int max_frames = 60;        ///< range maps used, evenly spread, >= 1; 0 = all
  int stride = 2;             ///< every n-th row and column is used, >= 1
  double max_range_m = 25.0;  ///< farther surface is left out [m]
  int threads = 0;            ///< 0 = one for each CPU
};

/// Samples of the true surface, as all range maps together see it. All columns have one length; positions are metres in
/// the frame of the truth minus GroundTruth::origin.
struct Surface {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< unit; the sign means nothing
  std::vector<float> weights;   ///< visibility: cos(latitude), i.e. solid angle, summed over all samples in the cube
  std::vector<float> spacings;  ///< distance between neighbouring samples where the surface was seen from nearest [m]
};

/// Throws IoError, InvalidInput.
Surface build_surface(const GroundTruth& truth, const SurfaceOptions& options = {});

}  // namespace pmsp::eval
