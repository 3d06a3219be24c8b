// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/plane_map.h"
#include "pmsp/transform.h"

namespace pmsp {

/// How far a keyframe has seen: what is kept of its depth map for the rest of the mission, two bytes a pixel. One cell
/// stands for 2 x 2 pixels.
struct RangeMap {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added
  Image<float> nearest;           ///< smallest depth in the cell [keyframe's unit]; 0 = none known
  Image<float> farthest;          ///< largest depth
  double scale = 1.0;             ///< the keyframe's unit in scene units
};

/// `map`, of even size; `confidence`: from the consistency filter, 0 = no depth.
PMSP_API RangeMap range_map(const PlaneMap& map, const Image<float>& confidence, const Executor& executor);

}  // namespace pmsp
