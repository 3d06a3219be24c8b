// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "pmsp/keyframe.h"

namespace pmsp {

/// Chooses source keyframes for a depth map among `sequence` (in the order of flight): those whose parallax with the
/// reference is most useful for matching, from both sides of it where both exist. `count` at most; none from the same
/// place. Returns indices into `sequence`, the most useful first. Only poses and landmarks are read.
std::vector<std::size_t> choose_neighbours(const std::vector<const Keyframe*>& sequence, std::size_t reference,
                                           int count);

/// Chooses further source keyframes among `candidates`: those that see most of what the reference sees under a parallax
/// that is more useful than what the chosen ones offer, in shares of the solid angle in which the reference has
/// landmarks. `count` at most; fewer where there is little to gain. Returns indices into `candidates`.
std::vector<std::size_t> choose_revisits(const Keyframe& reference, const std::vector<const Keyframe*>& chosen,
                                         const std::vector<const Keyframe*>& candidates, int count);

/// How far from the reference, in accepted keyframes, neighbours are looked for.
int neighbour_reach(int count);

}  // namespace pmsp
