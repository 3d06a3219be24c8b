// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/executor_impl.h"
#include "init/host_keys.h"
#include "pmsp/initialiser.h"
#include "sphere/grid.h"
#include "util/eigen_kernels.h"

namespace pmsp {

PlaneMap warp_planes(const PlaneMap& previous, const RigidTransform& cam_from_world, int width, int height,
                     const Executor& executor) {
  const SphereGrid grid(previous.width(), previous.height());
  const RigidTransform moved = cam_from_world * previous.cam_from_world.inverse();
  std::vector<std::uint64_t> keys(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), kernels::kNoKey);
  executor.impl().run_plainly(kernels::WarpPixels<kernels::HostMachine, HostKeys>{
      view_of(previous), grid.view(), to_rigid(moved), width, height, {keys.data()}});
  PlaneMap planes = planes_of_keys(
      kernels::WarpedPlanes<kernels::PlaneMapView>{keys.data(), view_of(previous), to_rigid(moved.inverse())}, width,
      height);
  planes.cam_from_world = cam_from_world;
  return planes;
}

}  // namespace pmsp
