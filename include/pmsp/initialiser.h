// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp/depth_map.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/keyframe.h"
#include "pmsp/options.h"

namespace pmsp {

/// A plane for each pixel of a depth map: the vector v with v . X = 1 for the points X of the plane, in the camera
/// frame. The range along a unit bearing b is 1 / (v . b), the unit normal that faces the camera -v / |v|. Zero = no
/// plane.
using PlaneImage = Image<Eigen::Vector3f>;

/// Depths that single precision bears, in squares and products of three: what lies nearer or farther is passed over
/// [scene units].
constexpr double kMinDepth = 1e-6;
constexpr double kMaxDepth = 1e6;
inline bool is_usable_depth(double depth) { return depth >= kMinDepth && depth <= kMaxDepth; }

/// Smallest and largest range that a keyframe's pixels are looked for in [scene units].
struct DepthRange {
  double min = 0.0;
  double max = 0.0;
};

/// Range of the keyframe's landmarks (2nd to 98th percentile), widened by `options.range_margin` at both ends, from
/// kMinDepth to kMaxDepth at most; {0, 0} when it observes none that lies between these.
DepthRange depth_range(const Keyframe& keyframe, const InitOptions& options);

/// Planes through the keyframe's landmarks, `width` x `height`: each pixel within `options.sparse_radius_px` of a
/// landmark gets the plane of the nearest one, perpendicular to the ray to it.
PlaneImage planes_from_landmarks(const Keyframe& keyframe, int width, int height, const InitOptions& options);

/// The planes of one keyframe's depth map moved into another keyframe, `width` x `height`: each is seen where its
/// pixel's surface point is; where several meet, the nearest to the camera wins. (Surmann et al. 2022, section III-B;
/// normals turn with the camera.)
PlaneImage warp_planes(const DepthMap& previous, const RigidTransform& cam_from_world, int width, int height,
                       const Executor& executor);

}  // namespace pmsp
