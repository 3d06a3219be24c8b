// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "pmsp/filters.h"

namespace pmsp {

void consistency_filter(DepthMap& map, const std::vector<const DepthMap*>& others, const ConsistencyFilterOptions& options,
                        const Executor& executor, FilterStats* stats) {
  options.validate();
  const std::int64_t before = count_depths(map);
  if (options.enabled && !others.empty()) {
    const int width = map.depth.width();
    const int height = map.depth.height();
    ThreadPool& pool = executor.impl().pool;
    const SphereGrid grid(width, height);
    std::vector<PlaneRows> planes;
    planes.reserve(others.size());   // jobs point into it
    std::vector<cpu::CompareJob> jobs;
    for (const DepthMap* other : others) {
      planes.emplace_back(*other, grid, pool);
      jobs.push_back({grid.tables(), map.depth.pixels().data(), planes.back().view(),
                      to_rigid(other->cam_from_world * map.cam_from_world.inverse())});
    }
    const double share = static_cast<double>(others.size()) / (options.window - 1);
    const int wanted = std::max(1, static_cast<int>(std::lround((options.min_views - 1) * std::min(share, 1.0))));
    const float tolerance = static_cast<float>(options.max_relative_depth);
    Image<float> filtered = map.depth;
    pool.for_each(height, [&](int y) {
      CompareBuffers buffers(width);
      std::vector<int> agreeing(static_cast<std::size_t>(width), 0);
      for (const cpu::CompareJob& job : jobs) {
        executor.impl().rows.compare_row(job, y, buffers.out());
        for (std::size_t x = 0; x < agreeing.size(); ++x) {
          if (std::fabs(buffers.closeness[x] - 1.0F) <= tolerance) ++agreeing[x];
        }
      }
      for (int x = 0; x < width; ++x) {
        const int count = agreeing[static_cast<std::size_t>(x)];
        map.confidence(x, y) *= static_cast<float>(count) / static_cast<float>(others.size());
        if (count < std::min(wanted, options.min_views - 1)) filtered(x, y) = 0.0F;
      }
    });
    map.depth = std::move(filtered);
    clear_where_no_depth(map);
  }
  if (stats != nullptr) *stats = {before, count_depths(map)};
}

}  // namespace pmsp
