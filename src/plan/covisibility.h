// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp {

/// What a keyframe sees of its surroundings, by its landmarks, in a few hundred cells of a coarse panorama: enough to
/// tell whether it and another keyframe see the same.
struct Covisibility {
  explicit Covisibility(const Keyframe& keyframe);

  RigidTransform cam_from_world;
  std::vector<float> farthest;  ///< range of the farthest landmark of each cell, 0 = none: so far it is known to see

  /// One landmark, the middle one by range, for each cell that has any.
  struct Sample {
    Eigen::Vector3d position_world;
    double solid_angle;  ///< share of the cell in that of all cells with landmarks
  };
  std::vector<Sample> samples;
};

/// How useful source keyframes are for matching what the reference sees, 0 to 1: the best of them, averaged over the
/// solid angle with landmarks.
double covisible_usefulness(const Covisibility& reference, const std::vector<const Covisibility*>& sources);

/// Chooses source keyframes among `candidates`, from anywhere in the mission, one after the other: the one that sees
/// most of what the reference sees under a parallax that is more useful than what those before it offer. `count` at
/// most; fewer where there is little to gain. Returns indices into `candidates`.
std::vector<std::size_t> choose_covisible(const Covisibility& reference,
                                          const std::vector<const Covisibility*>& candidates, int count);

}  // namespace pmsp
