// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/ground_truth.h"

namespace pmsp::eval {

struct SurfaceOptions {
  double voxel_m = 0.01;      ///< cube with one sample each [m], > 0
  int max_frames = 60;        ///< range maps used, evenly spread; 0 = all
  int stride = 2;             ///< subsampling of rows and columns, >= 1
  double max_range_m = 25.0;  ///< farther surface is ignored [m]
  int threads = 0;            ///< 0 = one per CPU
};

/// Samples of the true surface, scanned or seen by all range maps. The vectors have the same length; positions are
/// metres in the frame of the truth minus GroundTruth::origin.
struct Surface {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< unit; of arbitrary sign
  /// Visibility: cos(latitude), i.e. solid angle, summed over the samples in the cube; empty for scans, whose
  /// visibility is unknown.
  std::vector<float> weights;
  std::vector<float> spacings;  ///< distance of adjacent samples in the nearest view or the scan [m]
};

/// Builds it from the scan if there is one, else from the range maps. Throws IoError, InvalidInput.
Surface build_surface(const GroundTruth& truth, const SurfaceOptions& options = {});

}  // namespace pmsp::eval
