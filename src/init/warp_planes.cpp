// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_processor.h"
#include "densifier_checks.h"
#include "pmsp/stages.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {

PlaneMap warp_planes(const PlaneMap& previous, const KeyframePose& pose, int width, int height,
                     const Executor& executor, double lens_distance) {
  using kernels::HostViewTypes;
  check_scale("warp_planes: ", previous.scale);
  check_scale("warp_planes: ", pose.scale);
  const SphereGrid from(previous.width(), previous.height());
  const CpuProcessor on(executor, width, height);
  const auto keys = on.keys();
  on.launch(
      kernels::WarpPixels<HostViewTypes, HostKeys>{
          view_of(previous),
          from.view(),
          relative_pose(pose, previous.pose(), 0.5 * lens_distance).other_from_first,
          width,
          height,
          {keys.get()}},
      nullptr);
  PlaneMap planes(width, height);
  planes.cam_from_world = pose.cam_from_world;
  planes.scale = pose.scale;
  on.launch(
      kernels::PlanesOfKeys<HostViewTypes, kernels::WarpedPlanes<kernels::PlaneMapView>>{
          {keys.get(), view_of(previous), relative_pose(previous.pose(), pose, 0.5 * lens_distance).other_from_first},
          on.grid(),
          arrays_of(planes)},
      nullptr);
  return planes;
}

}  // namespace pmsp
