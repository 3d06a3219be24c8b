// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/executor_impl.h"
#include "filters/filter_setup.h"
#include "pmsp/stages.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"

namespace pmsp {

PlaneMap median_filter(const PlaneMap& map, const MedianFilterOptions& options, const Executor& executor,
                       FilterStats* stats) {
  options.validate();
  PlaneMap filtered(map.width(), map.height());
  filtered.keyframe_id = map.keyframe_id;
  filtered.cam_from_world = map.cam_from_world;
  filtered.scale = map.scale;
  const SphereGrid grid(map.width(), map.height());
  const auto counts = impl_of(executor).run(
      median_stage<kernels::HostViewTypes>(view_of(map), grid.view(), {nullptr}, options, arrays_of(filtered)));
  if (stats != nullptr) *stats = {counts[1], counts[2]};
  return filtered;
}

}  // namespace pmsp
