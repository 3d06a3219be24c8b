// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/plane_priors.h"

#include <cmath>
#include <cstdlib>
#include <vector>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "patchmatch/match_setup.h"
#include "plane_prior.h"
#include "sphere/grid.h"
#include "sphere/panorama_data.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

/// A depth map's planes and photometric scores in row order.
struct ScoredPlanes : kernels::PlaneMapView {
  const float* score;
};
float score_at(const ScoredPlanes& map, int index) { return map.score[index]; }

struct PriorJob {
  kernels::ReliableMap<ScoredPlanes> reliable;
  kernels::PlaneLimits limits;
  int columns, rows;  ///< of cells
  float* x;           ///< supports, written by support_row
  float* y;
  float* z;
  unsigned char* plain;
  kernels::Surroundings* around;  ///< written by surround_row
  kernels::PriorPlane* found;
  kernels::PriorPlane* chosen;  ///< written by choose_row
};

void support_row(const PriorJob& job, int row) {
  for (int column = 0; column < job.columns; ++column) {
    const kernels::CellView view = kernels::view_cell(job.reliable, column, row, job.columns, job.rows);
    const int cell = row * job.columns + column;
    job.x[cell] = view.support.x;
    job.y[cell] = view.support.y;
    job.z[cell] = view.support.z;
    job.plain[cell] = view.plain ? 1 : 0;
  }
}

void surround_row(const PriorJob& job, int row) {
  for (int column = 0; column < job.columns; ++column) {
    const int cell = row * job.columns + column;
    job.found[cell] = {};
    if (job.plain[cell] == 0) continue;
    const kernels::CellFrame frame = kernels::cell_frame(column, row, job.columns, job.rows);
    kernels::look_around(job.around[cell], {job.x, job.y, job.z, job.columns, job.rows}, frame);
    job.found[cell] = kernels::surrounded_plane(job.around[cell], frame.center, job.limits);
  }
}

void choose_row(const PriorJob& job, int row) {
  for (int column = 0; column < job.columns; ++column) {
    const int cell = row * job.columns + column;
    kernels::PriorPlane best = job.found[cell];
    if (job.plain[cell] != 0) {
      const kernels::CellFrame frame = kernels::cell_frame(column, row, job.columns, job.rows);
      for (int i = 0; i < 9; ++i) {
        const int other_row = row + i / 3 - 1;
        const int other_column = (column + i % 3 - 1 + job.columns) % job.columns;
        if (i == 4 || other_row < 0 || other_row >= job.rows) continue;
        const kernels::PriorPlane& other = job.found[other_row * job.columns + other_column];
        if (other.support.count > 0) {
          kernels::consider(best, other.plane, job.around[cell], frame.center, job.limits);
        }
      }
    }
    job.chosen[cell] = best;
  }
}


double env(const char* n, double d) { return std::getenv(n) != nullptr ? std::atof(std::getenv(n)) : d; }
}

PlaneImage plane_priors(const DepthMap& map, const Panorama& panorama, const DepthRange& range,
                        const PatchMatchOptions& options, const Executor& executor) {
  const int width = map.depth.width();
  const int height = map.depth.height();
  ThreadPool& pool = executor.impl().pool;
  const cpu::RowKernels& kernels_of = executor.impl().rows;
  const SphereGrid grid(width, height);
  const PlaneRows planes(map, grid, pool);
  const float contrast = static_cast<float>(env("RTEX", options.fine_patch_contrast));
  const int columns = std::min(static_cast<int>(env("COLS", 160)), width / 2);
  const int rows = std::max(columns / 2, 1);
  const std::size_t count = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  std::vector<float> variance(map.depth.size());
  std::vector<float> x(count), y(count), z(count);
  std::vector<unsigned char> plain(count);
  std::vector<kernels::Surroundings> around(count);
  std::vector<kernels::PriorPlane> found(count);
  std::vector<kernels::PriorPlane> chosen(count);
  PriorJob job{};
  cpu::VarianceJob texture{};
  texture.image = panorama.data().gray.view();
  texture.grid = grid.tables();
  texture.spacing = static_cast<float>(std::tan(env("TSP", 1.2) * 2.0 * kernels::kPi / width));
  texture.variance = variance.data();
  static_cast<kernels::PlaneMapView&>(job.reliable.map) = planes.view();
  job.reliable.map.score = map.confidence.pixels().data();
  job.reliable.variance = variance.data();
  job.reliable.sin_lon = grid.sin_lon();
  job.reliable.cos_lon = grid.cos_lon();
  job.reliable.sin_lat = grid.sin_lat();
  job.reliable.cos_lat = grid.cos_lat();
  job.reliable.min_variance = contrast * contrast;
  job.limits = plane_limits(options, range);
  job.columns = columns;
  job.rows = rows;
  job.x = x.data();
  job.y = y.data();
  job.z = z.data();
  job.plain = plain.data();
  job.around = around.data();
  job.found = found.data();
  job.chosen = chosen.data();
  pool.for_each(height, [&](int row) { kernels_of.variance_row(texture, row); });
  pool.for_each(rows, [&](int row) { support_row(job, row); });
  pool.for_each(rows, [&](int row) { surround_row(job, row); });
  for (int i = 0; i < static_cast<int>(env("ROUNDS", 1)); ++i) {
    pool.for_each(rows, [&](int row) { choose_row(job, row); });
    std::swap(job.found, job.chosen);
  }
  PlaneImage result(width, height, Eigen::Vector3f::Zero());
  pool.for_each(height, [&](int row) {
    for (int column = 0; column < width; ++column) {
      if (!(map.depth(column, row) > 0.0F)) continue;
      if (variance[static_cast<std::size_t>(row * width + column)] >= job.reliable.min_variance) continue;
      result(column, row) = to_eigen(job.found[row * rows / height * columns + column * columns / width].plane);
    }
  });
  if (std::getenv("DUMP") != nullptr) {
    static int n = 0;
    FILE* f = fopen((std::string(std::getenv("DUMP")) + std::to_string(n++) + ".bin").c_str(), "wb");
    int head[] = {width, height, columns, rows};
    fwrite(head, 4, 4, f);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        const float q = kernels::dot(to_vec3(result(u, v)), job.reliable.bearing_at(u, v));
        const float out[2] = {q > 0 ? 1 / q : 0, std::sqrt(variance[static_cast<std::size_t>(v * width + u)])};
        fwrite(out, 4, 2, f);
      }
    for (std::size_t c = 0; c < count; ++c) {
      const float out = std::sqrt(x[c] * x[c] + y[c] * y[c] + z[c] * z[c]);
      fwrite(&out, 4, 1, f);
    }
    fclose(f);
  }
  return result;
}

}  // namespace pmsp
