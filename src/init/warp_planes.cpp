// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_processor.h"
#include "pmsp/initialiser.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {

PlaneMap warp_planes(const PlaneMap& previous, const RigidTransform& cam_from_world, int width, int height,
                     const Executor& executor) {
  using kernels::HostMachine;
  const SphereGrid from(previous.width(), previous.height());
  const CpuProcessor on(executor, width, height);
  const RigidTransform moved = cam_from_world * previous.cam_from_world.inverse();
  const auto keys = on.keys();
  on.launch(
      kernels::WarpPixels<HostMachine, HostKeys>{
          view_of(previous), from.view(), to_rigid(moved), width, height, {keys.get()}},
      nullptr);
  PlaneMap planes(width, height);
  planes.cam_from_world = cam_from_world;
  on.launch(
      kernels::PlanesOfKeys<HostMachine, kernels::WarpedPlanes<kernels::PlaneMapView>>{
          {keys.get(), view_of(previous), to_rigid(moved.inverse())}, on.grid(), arrays_of(planes)},
      nullptr);
  return planes;
}

}  // namespace pmsp
