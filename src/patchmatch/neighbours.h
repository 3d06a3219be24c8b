// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "pmsp/types.h"

namespace pmsp {

/// Chooses source views for a depth map from `sequence` (in temporal order): those with the most useful parallax to the
/// reference, from both sides of it if possible; at most `count`, none at the same position. Returns indices into
/// `sequence`, the most useful first. Reads poses and landmarks only.
std::vector<std::size_t> choose_neighbours(const std::vector<const Keyframe*>& sequence, std::size_t reference,
                                           int count);

/// Usefulness of a keyframe as source view of another, 0 to 1, from the parallax of common landmarks.
double neighbour_usefulness(const Keyframe& reference, const Keyframe& other);

/// Usefulness of a parallax [deg] for matching, 0 to 1: a small one is inaccurate, with a large one patches differ.
double parallax_usefulness(double parallax_deg);

/// Search range for source views [accepted keyframes from the reference].
int neighbour_reach(int count);

}  // namespace pmsp
