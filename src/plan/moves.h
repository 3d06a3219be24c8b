// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp {

/// Poses of two keyframes.
struct PosePair {
  KeyframePose other, own;
};

/// Returns the displacement, between two states, of points at `distance` [unit of `own`] in the other keyframe's view
/// [rad].
double moved_angle(const PosePair& then, const PosePair& now, double distance);

/// Returns the displacement [px of `width`].
PMSP_API double moved_px(const PosePair& then, const PosePair& now, double distance, int width);

}  // namespace pmsp
