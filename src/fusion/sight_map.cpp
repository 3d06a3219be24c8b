// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/sight_map.h"

#include "cpu/executor_impl.h"
#include "pmsp/error.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"

namespace pmsp {

SightMap sight_map(const PlaneMap& map, const Image<float>& confidence, const Executor& executor) {
  if (!same_size(map, confidence)) throw InvalidInput("sight_map: planes and confidences differ in size");
  const int width = map.width() / kernels::kSightCell;
  const int height = map.height() / kernels::kSightCell;
  const SphereGrid grid(map.width(), map.height());
  SightMap sight{map.keyframe_id, map.cam_from_world, Image<float>(width, height), Image<float>(width, height),
                 map.scale};
  executor.impl().run(kernels::FindSight<kernels::HostMachine>{
      view_of(map, confidence), grid.view(), sight.nearest.pixels().data(), sight.farthest.pixels().data()});
  return sight;
}

}  // namespace pmsp
