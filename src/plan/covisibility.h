// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp {

/// Visible surroundings of a keyframe, from its landmarks, in a few hundred cells of a coarse panorama: sufficient for
/// comparing the views of keyframes.
struct Covisibility {
  explicit Covisibility(const Keyframe& keyframe);

  RigidTransform cam_from_world;
  std::vector<float> farthest;  ///< by cell: range of the farthest landmark, the limit of known visibility; 0 = none

  /// Landmark of median range, in each cell with landmarks.
  struct Sample {
    Eigen::Vector3d position_world;
    double solid_angle;  ///< of the cell, relative to all cells with landmarks
  };
  std::vector<Sample> samples;
};

/// Returns the usefulness of source views for matching, 0 to 1: of the best one for each sample, averaged over the
/// solid angle with landmarks.
double covisible_usefulness(const Covisibility& reference, const std::vector<const Covisibility*>& sources);

/// Selects source views among `candidates`, from the whole mission, one after the other: each adds most usefulness, by
/// common visibility and better parallax, to the previous ones. At most `count`; fewer if the gain is small. Returns
/// indices into `candidates`.
std::vector<std::size_t> choose_covisible(const Covisibility& reference,
                                          const std::vector<const Covisibility*>& candidates, int count);

}  // namespace pmsp
