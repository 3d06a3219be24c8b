// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/api.h"
#include "pmsp/depth_map.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/transform.h"

namespace pmsp {

/// A keyframe's geometry as the stages work on it: a plane for each pixel, the vector v with v . X = 1 for the points X
/// of the plane, in the camera frame and the keyframe's unit. The range along a unit bearing b is 1 / (v . b), the unit
/// normal that faces the camera is -v / |v|. Zero = no plane. Where v . b is above 0 and below 1e-9, the
/// pixel is too far for any parallax, such as the sky. The images have one size, cover the whole sphere and are indexed
/// (column, row).
struct PlaneMap {
  PlaneMap() = default;
  /// Without planes.
  PlaneMap(int width, int height) : x(width, height), y(width, height), z(width, height), score(width, height) {}

  int width() const { return x.width(); }
  int height() const { return x.height(); }
  bool empty() const { return x.empty(); }

  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added
  double scale = 1.0;             ///< of the keyframe, likewise
  KeyframePose pose() const { return {cam_from_world, scale}; }
  Image<float> x, y, z;
  Image<float> score;  ///< photometric (NCC), up to 1, and what priors add (scores_without_priors)
};

/// Depth, normal and confidence of the planes; far pixels have none. `confidence`: of each pixel, 0 = leave it out;
/// nullptr = the score, 0 to
/// 1. Throws InvalidInput when sizes differ.
PMSP_API DepthMap depth_map_of(const PlaneMap& planes, const Image<float>* confidence, const Executor& executor);

/// The other way round; scores are the confidences.
PMSP_API PlaneMap plane_map_of(const DepthMap& map, const Executor& executor);

}  // namespace pmsp
