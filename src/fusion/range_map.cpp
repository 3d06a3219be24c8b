// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/stages.h"

#include "cpu/executor_impl.h"
#include "pmsp/error.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"

namespace pmsp {

RangeMap range_map(const PlaneMap& map, const Image<float>& confidence, const Executor& executor) {
  if (!same_size(map, confidence)) throw InvalidInput("range_map: planes and confidences differ in size");
  const int width = map.width() / kernels::kRangeCell;
  const int height = map.height() / kernels::kRangeCell;
  const SphereGrid grid(map.width(), map.height());
  RangeMap ranges{map.keyframe_id, map.cam_from_world, Image<float>(width, height), Image<float>(width, height),
                  map.scale};
  impl_of(executor).run(kernels::FindRanges<kernels::HostViewTypes>{
      view_of(map, confidence), grid.view(), ranges.nearest.pixels().data(), ranges.farthest.pixels().data()});
  return ranges;
}

}  // namespace pmsp
