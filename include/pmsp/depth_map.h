// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/image.h"
#include "pmsp/transform.h"

namespace pmsp {

/// Dense geometry of one keyframe. The three images have one size, cover the whole sphere (pixel centres as in
/// pmsp::Keyframe) and are indexed (column, row).
struct DepthMap {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added
  /// Euclidean distance along the bearing [keyframe's unit] from the camera's centre, or from the lens where it has two
  /// (DensifierOptions::lens_distance); 0 = no estimate.
  Image<float> depth;
  Image<Eigen::Vector3f> normal;  ///< unit, camera frame, facing the camera; (0, 0, 0) where depth is 0
  /// 0 (none) to 1; 0 where depth is 0. Straight from PatchMatch it is the photometric score (NCC), and it stays that
  /// where the consistency filter is off or has no other map to look at. After that filter it says how far the depth
  /// may be off: a confidence c stands for an expected relative error (median) of 0.5 % * (1 - c) / c, so 0.5 for 0.5
  /// %, 0.8 for 0.13 % and 0.1 for 4.5 %.
  Image<float> confidence;
  double scale = 1.0;  ///< the keyframe's unit in scene units
};

class Executor;

/// Normals of a depth map that has none, as DepthMap wants them: of the plane that fits the depths around a pixel,
/// those beyond an edge (a tenth of the depth) left out. The window is five samples wide and high, 1/640 of the circle
/// apart, at least a pixel. Facing the camera exactly where there is too little surface, never more slanted than 80
/// degrees. Depths out of range (0, not finite) count as none.
PMSP_API Image<Eigen::Vector3f> estimate_normals(const Image<float>& depth, const Executor& executor);

}  // namespace pmsp
