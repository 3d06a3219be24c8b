// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/depth_map.h"
#include "pmsp/executor.h"
#include "pmsp/initialiser.h"
#include "pmsp/keyframe.h"
#include "pmsp/panorama.h"

namespace pmsp {

PlaneImage plane_priors(const DepthMap& map, const Panorama& panorama, const DepthRange& range,
                        const PatchMatchOptions& options, const Executor& executor);

}  // namespace pmsp
