// SPDX-License-Identifier: BSD-2-Clause
#include "weighted_median.h"

#include <string>

#include "cpu/cpu_processor.h"
#include "cpu/executor_impl.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"

namespace pmsp {

PlaneMap weighted_median_filter(const PlaneMap& map, const Panorama& panorama, const Executor& executor) {
  if (map.width() != panorama.width() || map.height() != panorama.height()) {
    throw InvalidInput("weighted_median_filter: the map has " + std::to_string(map.width()) + " x " +
                       std::to_string(map.height()) + " pixels, the panorama " + std::to_string(panorama.width()) +
                       " x " + std::to_string(panorama.height()) + "; they must be equal");
  }
  PlaneMap filtered(map.width(), map.height());
  filtered.keyframe_id = map.keyframe_id;
  filtered.cam_from_world = map.cam_from_world;
  filtered.scale = map.scale;
  const SphereGrid grid(map.width(), map.height());
  const Array<std::uint32_t> color = color_words(panorama.color(), executor);
  const std::uint8_t* const unmasked = panorama.mask().empty() ? nullptr : panorama.mask().row(0);
  impl_of(executor).run(kernels::WeightedMedian<kernels::HostViewTypes>{
      view_of(map), grid.view(), color.get(), {unmasked}, arrays_of(filtered)});
  return filtered;
}

}  // namespace pmsp
