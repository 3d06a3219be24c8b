// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "fused_point.h"
#include "ownership.h"
#include "pmsp/fusion.h"
#include "pmsp/options.h"
#include "sight.h"

// What the kernels of fusion are given, on every machine.
namespace pmsp {

/// A keyframe's place as another one's kernels take it.
struct Relation {
  kernels::Rigid other_from_first;
  float zoom;
};
Relation relation(const KeyframePose& other, const KeyframePose& first);

kernels::FusionLimits fusion_limits(const FusionOptions& options);
kernels::OwnershipLimits ownership_limits(const FusionOptions& options);
kernels::SightLimits sight_limits(const FreeSpaceOptions& options);

}  // namespace pmsp
