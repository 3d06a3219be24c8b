// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/sight_map.h"

#include <algorithm>

#include "cpu/executor_impl.h"

namespace pmsp {
namespace {

constexpr int kCell = 2;  ///< pixels of the depth map along a cell's side

}  // namespace

SightMap sight_map(const DepthMap& map, const Executor& executor) {
  const int width = map.depth.width() / kCell;
  const int height = map.depth.height() / kCell;
  SightMap sight{map.keyframe_id, map.cam_from_world, Image<float>(width, height), Image<float>(width, height)};
  executor.impl().pool.for_each(height, [&](int row) {
    for (int y = row * kCell; y < (row + 1) * kCell; ++y) {
      for (int x = 0; x < width * kCell; ++x) {
        const float depth = map.depth(x, y);
        if (depth <= 0.0F) continue;
        float& nearest = sight.nearest(x / kCell, row);
        float& farthest = sight.farthest(x / kCell, row);
        nearest = nearest > 0.0F ? std::min(nearest, depth) : depth;
        farthest = std::max(farthest, depth);
      }
    }
  });
  return sight;
}

}  // namespace pmsp
