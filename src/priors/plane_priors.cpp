// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/plane_priors.h"

#include "cpu/cpu_processor.h"
#include "patchmatch/match_setup.h"
#include "pmsp/error.h"
#include "priors/prior_setup.h"
#include "sphere/panorama_data.h"
#include "sphere/plane_views.h"

namespace pmsp {

PlaneMap plane_priors(const PlaneMap& map, const Panorama& panorama, const DepthRange& range,
                      const PatchMatchOptions& options, const Executor& executor, ImageView<const float> prior_depth) {
  if (!same_size(map, panorama)) throw InvalidInput("plane_priors: the map is not of the panorama's size");
  const CpuProcessor on(executor, map.width(), map.height());
  PlaneMap priors(map.width(), map.height());
  priors.keyframe_id = map.keyframe_id;
  priors.cam_from_world = map.cam_from_world;
  priors.scale = map.scale;
  const PriorGrid grid(map.width(), map.height());
  Array<kernels::Vec3<float>> given;
  if (!prior_depth.empty()) given = on.upload(given_planes(prior_depth, map.scale, grid));
  find_plane_priors(on, on.upload(look_table(grid)), given, view_of(map), panorama.data().gray.view(),
                    plane_limits(options, range), options, arrays_of(priors));
  return priors;
}

}  // namespace pmsp
