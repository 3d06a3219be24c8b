// SPDX-License-Identifier: BSD-2-Clause
#include "init/host_keys.h"
#include "init/init_setup.h"
#include "pmsp/initialiser.h"
#include "sphere/grid.h"

namespace pmsp {

PlaneMap planes_from_landmarks(const Keyframe& keyframe, int width, int height, const InitOptions& options) {
  const SphereGrid grid(width, height);
  std::vector<kernels::SparsePoint> points(keyframe.landmarks.size());
  const int count = static_cast<int>(sparse_points(keyframe, width, height, points.data()));
  std::vector<std::uint64_t> keys(grid.size(), kernels::kNoKey);
  const kernels::SplatLandmarks<HostKeys> splat{
      points.data(), grid.view(), static_cast<float>(options.sparse_radius_px), {keys.data()}};
  for (int i = 0; i < count; ++i) splat(i, 0, 1);
  PlaneMap planes = planes_of_keys(kernels::LandmarkPlanes{keys.data(), points.data()}, width, height);
  planes.keyframe_id = keyframe.id;
  planes.cam_from_world = keyframe.cam_from_world;
  return planes;
}

}  // namespace pmsp
