// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/initialiser.h"
#include "pmsp/options.h"
#include "pmsp/panorama.h"
#include "pmsp/plane_map.h"

namespace pmsp {

/// Planes for the pixels of painted walls, ceilings and the like, where patches look alike under any plane: through
/// the reliable surface that surrounds them. `map` is what a pass of PatchMatch found in `panorama`, of the same size.
/// Pixels are without texture when, besides a linear ramp, their neighbourhood varies
/// by less than `options.fine_patch_contrast`; only they get a plane, and only if at least five of the first reliable
/// points that lie around them in 16 directions, within 80 degrees, share it to 2 % of their depth, three of which
/// surround the pixel. Others get (0, 0, 0), or where there is a `prior_depth` (see Keyframe) the plane that it has in
/// and around a cell of 1/160 of the sphere's width, corrected by how far the reliable points around are off it: only
/// if three or more, which count for 60 % of them, agree with each other to 10 % about that. Planes keep within `range`
/// and `options.max_slant_deg`. Throws InvalidInput when the sizes of map and panorama differ.
PlaneMap plane_priors(const PlaneMap& map, const Panorama& panorama, const DepthRange& range,
                      const PatchMatchOptions& options, const Executor& executor,
                      ImageView<const float> prior_depth = {});

}  // namespace pmsp
