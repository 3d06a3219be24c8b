// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/plane_priors.h"

#include <vector>

#include "cpu/executor_impl.h"
#include "patchmatch/match_setup.h"
#include "pmsp/error.h"
#include "priors/prior_setup.h"
#include "sphere/grid.h"
#include "sphere/panorama_data.h"
#include "sphere/plane_views.h"

namespace pmsp {

PlaneMap plane_priors(const PlaneMap& map, const Panorama& panorama, const DepthRange& range,
                      const PatchMatchOptions& options, const Executor& executor) {
  using kernels::HostMachine;
  if (!same_size(map, panorama)) throw InvalidInput("plane_priors: the map is not of the panorama's size");
  const SphereGrid grid(map.width(), map.height());
  std::vector<float> variance(grid.size());
  executor.impl().run(kernels::TextureVariance<HostMachine>{panorama.data().gray.view(), grid.view(),
                                                            texture_spacing(map.width()), variance.data()});
  const PriorGrid size(map.width(), map.height());
  const std::vector<int> looks = look_table(size);
  std::vector<kernels::Vec3<float>> supports(size.cells());
  std::vector<unsigned char> plain(size.cells());
  std::vector<kernels::Surroundings> around(size.cells());
  std::vector<kernels::PriorPlane> found(size.cells());
  std::vector<kernels::PriorPlane> chosen(size.cells());
  const kernels::PriorCells<kernels::PlaneMapView> cells{
      view_of(map),  grid.view(),  variance.data(), texture_variance(options), plane_limits(options, range),
      size.columns,  size.rows,    looks.data(),    supports.data(),           plain.data(),
      around.data(), found.data(), chosen.data()};
  const auto for_each_cell = [&](const auto& body) {
    executor.impl().pool.for_each(size.rows, [&](int row) {
      for (int column = 0; column < size.columns; ++column) body(column, row);
    });
  };
  for_each_cell([&](int column, int row) { kernels::find_support(cells, column, row); });
  for_each_cell([&](int column, int row) { kernels::find_plane(cells, column, row); });
  for_each_cell([&](int column, int row) { kernels::choose_plane(cells, column, row); });
  PlaneMap priors(map.width(), map.height());
  priors.keyframe_id = map.keyframe_id;
  priors.cam_from_world = map.cam_from_world;
  executor.impl().run_plainly(kernels::PixelPriors<HostMachine>{cells, arrays_of(priors)});
  return priors;
}

}  // namespace pmsp
