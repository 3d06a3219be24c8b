// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "pmsp/types.h"

namespace pmsp {

/// Chooses source keyframes for a depth map among `sequence` (in the order of flight): those whose parallax with the
/// reference is most useful for matching, from both sides of it where both exist. `count` at most; none from the same
/// place. Returns indices into `sequence`, the most useful first. Only poses and landmarks are read.
std::vector<std::size_t> choose_neighbours(const std::vector<const Keyframe*>& sequence, std::size_t reference,
                                           int count);

/// How useful one keyframe is for matching with the other, 0 to 1: by the parallax of the landmarks in common.
double neighbour_usefulness(const Keyframe& reference, const Keyframe& other);

/// How much a parallax [deg] helps matching, 0 to 1: too little tells nothing, with too much patches look different.
double parallax_usefulness(double parallax_deg);

/// How far from the reference, in accepted keyframes, neighbours are looked for.
int neighbour_reach(int count);

}  // namespace pmsp
