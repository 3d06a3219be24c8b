// SPDX-License-Identifier: BSD-2-Clause
#include <utility>

#include "confidence.h"
#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "pmsp/error.h"
#include "pmsp/filters.h"

namespace pmsp {

void consistency_filter(DepthMap& map, const std::vector<const DepthMap*>& others,
                        const ConsistencyFilterOptions& options, const Executor& executor, FilterStats* stats) {
  options.validate();
  for (const DepthMap* other : others) {
    if (!same_size(*other, map)) throw InvalidInput("consistency_filter: the depth maps differ in size");
  }
  const std::int64_t before = count_depths(map);
  if (options.enabled && !others.empty()) {
    const int width = map.depth.width();
    const int height = map.depth.height();
    ThreadPool& pool = executor.impl().pool;
    const SphereGrid grid(width, height);
    std::vector<PlaneRows> planes;
    planes.reserve(others.size());  // jobs point into it
    std::vector<cpu::CompareJob> jobs;
    for (const DepthMap* other : others) {
      planes.emplace_back(*other, grid, pool);
      jobs.push_back({grid.tables(), map.depth.pixels().data(), planes.back().view(),
                      to_rigid(other->cam_from_world * map.cam_from_world.inverse())});
    }
    const int wanted = agreeing_maps_wanted(options, others.size());
    const float tolerance = static_cast<float>(options.max_relative_depth);
    const float pixel_angle = static_cast<float>(2.0 * kernels::kPi / width);
    const PlaneRows own(map, grid, pool);
    Image<float> roughness(width, height);
    const cpu::RoughnessJob rough{grid.tables(), map.depth.pixels().data(), own.view(), roughness.pixels().data()};
    Image<float> filtered = map.depth;
    pool.for_each(height, [&](int y) {
      executor.impl().rows.roughness_row(rough, y);
      CompareBuffers buffers(width);
      std::vector<kernels::Votes> votes(static_cast<std::size_t>(width));
      for (const cpu::CompareJob& job : jobs) {
        executor.impl().rows.compare_row(job, y, buffers.out());
        for (std::size_t x = 0; x < votes.size(); ++x) {
          votes[x].add(buffers.closeness[x], buffers.parallax_gain[x], tolerance);
        }
      }
      for (int x = 0; x < width; ++x) {
        const kernels::Votes& vote = votes[static_cast<std::size_t>(x)];
        const float error = kernels::expected_error(vote, roughness(x, y), static_cast<int>(others.size()),
                                                    map.confidence(x, y), pixel_angle);
        map.confidence(x, y) = kernels::confidence_of_error(error);
        if (!vote.keep(wanted)) filtered(x, y) = 0.0F;
      }
    });
    map.depth = std::move(filtered);
    clear_where_no_depth(map);
  }
  if (stats != nullptr) *stats = {before, count_depths(map)};
}

}  // namespace pmsp
