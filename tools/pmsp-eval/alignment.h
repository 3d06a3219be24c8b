// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/trajectory.h"
#include "pmsp/io/cloud.h"

namespace pmsp::eval {

struct AlignmentOptions {
  bool enabled = true;           ///< false: map and truth share a frame and are only matched by time
  double time_offset = 0.0;      ///< added to the timestamps of the keyframes [s]
  double time_tolerance = 0.04;  ///< maximum time difference between a keyframe and its true pose [s], > 0
};

struct Alignment {
  Similarity truth_from_map;
  std::string method;          ///< "positions", "positions and orientations" (path on a line), "none" or "map is truth"
  std::vector<int> truth_row;  ///< per keyframe: row in the true trajectory, -1 = none
  int matched = 0;             ///< keyframes with a true pose
  int shared_timestamps = 0;   ///< keyframes skipped because of a repeated timestamp
  double position_rmse_m = 0.0;  ///< after alignment
  double position_max_m = 0.0;
  double rotation_median_deg = 0.0;
  double rotation_max_deg = 0.0;
};

/// Matches keyframes to true poses by timestamp and fits the similarity between their positions. For almost straight
/// paths (second singular value below 2 % of the first), which leave a rotation undetermined, the rotation is the mean
/// difference of orientations. `truth`: ascending in time. Throws InvalidInput if fewer than three keyframes match, or
/// matched positions coincide.
Alignment align(const std::vector<TimedPose>& keyframes, const std::vector<TimedPose>& truth,
                const AlignmentOptions& options = {});

/// Returns the alignment of keyframes whose poses are the true trajectory.
Alignment align_with_itself(const std::vector<TimedPose>& keyframes);

}  // namespace pmsp::eval
