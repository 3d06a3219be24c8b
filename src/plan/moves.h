// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/transform.h"

namespace pmsp {

/// Where two keyframes are.
struct PosePair {
  KeyframePose other, own;
};

/// By how much what a keyframe sees has moved in another one [px of `width`], for what lies at `range` [own unit].
double moved_px(const PosePair& then, const PosePair& now, double range, int width);

}  // namespace pmsp
