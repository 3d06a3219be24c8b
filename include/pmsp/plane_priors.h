// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/initialiser.h"
#include "pmsp/panorama.h"
#include "pmsp/plane_map.h"
#include "pmsp/transform.h"

namespace pmsp {

/// Planes for the pixels of painted walls, ceilings and the like, where patches look alike under any plane: through
/// the reliable surface that surrounds them. `map` is what a pass of PatchMatch found in `panorama`, of the same size,
/// when it matched it with keyframes at `neighbours`, 1 to 8. Pixels get a plane where the picture alone does not tell
/// their depth: where their neighbourhood varies, besides a linear ramp, by a standard deviation of less than 1.5 gray
/// levels, or where what varies along the lines on which the neighbours see them move leaves the depth uncertain by
/// more than 2 %. A plane is proposed only if at least five of the first reliable points that lie around them in 16
/// directions, within 80 degrees, share it to 2 % of their depth (uncertain points to 6 %), three of which surround the
/// pixel or one whose plane explains the pixel's surroundings better. Points in front of the plane count less against
/// it than points behind it.
///
/// Others get (0, 0, 0), or where there is a `prior_depth` (see Keyframe) the plane that it has in and around a cell of
/// 1/160 of the sphere's width, corrected by how far the reliable points around are off it: only if three or more,
/// which count for 60 % of them, agree with each other to 10 % about that. Planes keep within `range` and to 80 degrees
/// between their normal and the ray. Throws InvalidInput when the sizes of map and panorama differ, or when there are
/// too few or too many neighbours. After the idea of a planar prior of Xu and Tao 2020 (ACMP).
PMSP_API PlaneMap plane_priors(const PlaneMap& map, const Panorama& panorama,
                               const std::vector<KeyframePose>& neighbours, const DepthRange& range,
                               const Executor& executor, ImageView<const float> prior_depth = {});

/// Takes off `map`'s scores what `priors` have added in patchmatch(), up to 0.3; then they are cut off at 0 and 1. That
/// a plane agrees with a prior helps to choose it, and helps the median filters; it says nothing of how exact it is.
/// `map`: after the median filters; what consistency_filter tells of its errors is right only then. Throws InvalidInput
/// when the sizes differ.
PMSP_API PlaneMap scores_without_priors(const PlaneMap& map, const PlaneMap& priors, const Executor& executor);

}  // namespace pmsp
