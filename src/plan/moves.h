// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/types.h"
#include "util/io_api.h"

namespace pmsp {

/// Where two keyframes are.
struct PosePair {
  KeyframePose other, own;
};

/// By how much what a keyframe sees has moved in another one [rad], for what lies at `range` [own unit].
double moved_angle(const PosePair& then, const PosePair& now, double range);

/// The same [px of `width`].
PMSP_IO_API double moved_px(const PosePair& then, const PosePair& now, double range, int width);

}  // namespace pmsp
