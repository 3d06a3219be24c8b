// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/plane_priors.h"

#include <vector>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "patchmatch/match_setup.h"
#include "pmsp/error.h"
#include "priors/prior_setup.h"
#include "sphere/grid.h"
#include "sphere/panorama_data.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

/// A depth map's planes and photometric scores, in row order.
struct ScoredPlanes : kernels::PlaneMapView {
  const float* score;
};
float score_at(const ScoredPlanes& map, int index) { return map.score[index]; }

}  // namespace

PlaneImage plane_priors(const DepthMap& map, const Panorama& panorama, const DepthRange& range,
                        const PatchMatchOptions& options, const Executor& executor) {
  const int width = panorama.width();
  const int height = panorama.height();
  if (map.depth.width() != width || map.depth.height() != height) {
    throw InvalidInput("plane_priors: the depth map is not of the panorama's size");
  }
  ThreadPool& pool = executor.impl().pool;
  const SphereGrid grid(width, height);
  std::vector<float> variance(map.depth.size());
  const cpu::VarianceJob job{panorama.data().gray.view(), grid.tables(), texture_spacing(width), variance.data()};
  pool.for_each(height, [&](int y) { executor.impl().rows.variance_row(job, y); });

  const PlaneRows planes(map, grid, pool);
  const PriorGrid size(width, height);
  const std::vector<int> looks = look_table(size);
  std::vector<kernels::Vec3<float>> supports(size.cells());
  std::vector<unsigned char> plain(size.cells());
  std::vector<kernels::Surroundings> around(size.cells());
  std::vector<kernels::PriorPlane> found(size.cells());
  std::vector<kernels::PriorPlane> chosen(size.cells());
  const kernels::PriorCells<ScoredPlanes> cells{{planes.view(), map.confidence.pixels().data()},
                                                grid.sin_lon(),
                                                grid.cos_lon(),
                                                grid.sin_lat(),
                                                grid.cos_lat(),
                                                variance.data(),
                                                texture_variance(options),
                                                plane_limits(options, range),
                                                size.columns,
                                                size.rows,
                                                looks.data(),
                                                supports.data(),
                                                plain.data(),
                                                around.data(),
                                                found.data(),
                                                chosen.data()};
  const auto for_each_cell = [&](const auto& body) {
    pool.for_each(size.rows, [&](int row) {
      for (int column = 0; column < size.columns; ++column) body(column, row);
    });
  };
  for_each_cell([&](int column, int row) { kernels::find_support(cells, column, row); });
  for_each_cell([&](int column, int row) { kernels::find_plane(cells, column, row); });
  for_each_cell([&](int column, int row) { kernels::choose_plane(cells, column, row); });
  PlaneImage priors(width, height, Eigen::Vector3f::Zero());
  pool.for_each(height, [&](int y) {
    for (int x = 0; x < width; ++x) priors(x, y) = to_eigen(kernels::prior_at(cells, x, y));
  });
  return priors;
}

}  // namespace pmsp
