// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/stages.h"

#include <string>

#include "cpu/cpu_processor.h"
#include "cpu/executor_impl.h"
#include "patchmatch/match_setup.h"
#include "pmsp/error.h"
#include "priors/prior_setup.h"
#include "sphere/panorama_data.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {

PlaneMap plane_priors(const PlaneMap& map, const Panorama& panorama, const std::vector<KeyframePose>& neighbours,
                      const DepthRange& range, const Executor& executor, ImageView<const float> prior_depth,
                      double lens_distance) {
  if (!same_size(map, panorama)) throw InvalidInput("plane_priors: the map is not of the panorama's size");
  if (neighbours.empty() || neighbours.size() > static_cast<std::size_t>(kernels::kMaxViews)) {
    throw InvalidInput("plane_priors: there are " + std::to_string(neighbours.size()) + " neighbours; expected 1 to " +
                       std::to_string(kernels::kMaxViews));
  }
  const KeyframePose pose{map.cam_from_world, map.scale};
  kernels::Baselines baselines{};
  for (const KeyframePose& neighbour : neighbours) {
    baselines.to[baselines.count++] = baseline(relative_pose(neighbour, pose, 0.5 * lens_distance).other_from_first);
  }
  const CpuProcessor on(executor, map.width(), map.height());
  PlaneMap priors(map.width(), map.height());
  priors.keyframe_id = map.keyframe_id;
  priors.cam_from_world = map.cam_from_world;
  priors.scale = map.scale;
  const PriorGrid grid(map.width(), map.height());
  Array<kernels::Vec3<float>> prior_depth_planes;
  if (!prior_depth.empty()) prior_depth_planes = on.upload(planes_from_prior_depth(prior_depth, map.scale, grid));
  find_plane_priors(on, on.upload(great_circle_table(grid)), prior_depth_planes, view_of(map),
                    impl_of(panorama).gray.view(), impl_of(panorama).noise,
                    find_evidence(on, impl_of(panorama).gray.view(), baselines), plane_limits(range),
                    arrays_of(priors));
  return priors;
}

PlaneMap subtract_priors(const PlaneMap& map, const PlaneMap& priors, const Executor& executor) {
  if (!same_size(map, priors)) throw InvalidInput("scores_without_priors: the maps differ in size");
  PlaneMap result = map;
  const SphereGrid grid(map.width(), map.height());
  impl_of(executor).run(kernels::ScoresWithoutPriors<kernels::HostViewTypes>{view_of(map), view_of(priors), grid.view(),
                                                                             kPriorBonus, arrays_of(result)});
  return result;
}

}  // namespace pmsp
