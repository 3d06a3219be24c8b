// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/keyframe.h"
#include "pmsp/options.h"
#include "pmsp/plane_map.h"

namespace pmsp {

/// Depths that single precision bears, in squares and products of three: what lies nearer or farther is passed over
/// [keyframe's unit].
constexpr double kMinDepth = 1e-6;
constexpr double kMaxDepth = 1e6;
inline bool is_usable_depth(double depth) { return depth >= kMinDepth && depth <= kMaxDepth; }

/// Smallest and largest range that a keyframe's pixels are looked for in.
struct DepthRange {
  double min = 0.0;
  double max = 0.0;
};

/// Range of the keyframe's landmarks in its own unit (2nd to 98th percentile), widened by `options.range_margin` at
/// both ends, from kMinDepth to kMaxDepth at most; {0, 0} when it observes none that lies between these.
PMSP_API DepthRange depth_range(const Keyframe& keyframe, const InitOptions& options);

/// Planes through the keyframe's landmarks, `width` x `height`: each pixel within `options.sparse_radius_px` of a
/// landmark gets the plane of the nearest one, perpendicular to the ray to it. Scores are 0.
PMSP_API PlaneMap planes_from_landmarks(const Keyframe& keyframe, int width, int height, const InitOptions& options,
                                        const Executor& executor);

/// The planes of one keyframe moved into another one, `width` x `height`: each is seen where its pixel's surface point
/// is; where several meet, the nearest to the camera wins. (Surmann et al. 2022, section III-B; normals turn with the
/// camera.) Scores are 0. Throws InvalidInput when a scale is out of range.
PMSP_API PlaneMap warp_planes(const PlaneMap& previous, const KeyframePose& pose, int width, int height,
                              const Executor& executor);

}  // namespace pmsp
