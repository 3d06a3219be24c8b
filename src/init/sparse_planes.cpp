// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_processor.h"
#include "pmsp/stages.h"
#include "sphere/plane_views.h"

namespace pmsp {

PlaneMap planes_from_landmarks(const Keyframe& keyframe, int width, int height, const InitOptions& options,
                               const Executor& executor, double lens_distance) {
  using kernels::HostViewTypes;
  const CpuProcessor on(executor, width, height);
  const auto keys = on.keys();
  const auto [points, count] = on.landmarks(keyframe, 0.5 * lens_distance);
  on.splat({points.get(), on.grid(), static_cast<float>(options.sparse_radius_px), {keys.get()}}, count);
  PlaneMap planes(width, height);
  planes.keyframe_id = keyframe.id;
  planes.cam_from_world = keyframe.cam_from_world;
  planes.scale = keyframe.scale;
  on.launch(
      kernels::PlanesOfKeys<HostViewTypes, kernels::LandmarkPlanes>{
          {keys.get(), points.get()}, on.grid(), arrays_of(planes)},
      nullptr);
  return planes;
}

}  // namespace pmsp
