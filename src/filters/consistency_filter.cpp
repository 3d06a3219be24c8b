// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>

#include "confidence.h"
#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "pmsp/filters.h"

namespace pmsp {
namespace {

/// Where another map's surface lies behind the point by more than this many tolerances, that keyframe has looked
/// through it.
constexpr float kSeenThrough = 2.0F;

/// What the other maps say of one pixel.
struct Votes {
  int agree = 0;
  int contradict = 0;
  float square_spread = 0.0F;
  float square_gain = 0.0F;

  void add(float closeness, float parallax_gain, float tolerance) {
    const float deviation = closeness - 1.0F;
    if (std::fabs(deviation) <= tolerance) {
      ++agree;
      square_spread += deviation * deviation;
      square_gain += parallax_gain * parallax_gain;
    }
    if (closeness > 0.0F && closeness < 1.0F - kSeenThrough * tolerance) ++contradict;
  }

  float expected_error(float roughness, std::size_t maps, float pixel_angle) const {
    return kernels::expected_error<float>(
        {square_spread, square_gain, roughness, static_cast<float>(agree), static_cast<float>(maps)}, pixel_angle);
  }
};

}  // namespace

void consistency_filter(DepthMap& map, const std::vector<const DepthMap*>& others,
                        const ConsistencyFilterOptions& options, const Executor& executor, FilterStats* stats) {
  options.validate();
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
    const double share = static_cast<double>(others.size()) / (options.window - 1);
    const int full = options.min_views - 1;
    const int wanted = std::min(full, std::max(1, static_cast<int>(std::lround(full * std::min(share, 1.0)))));
    const float tolerance = static_cast<float>(options.max_relative_depth);
    const float pixel_angle = static_cast<float>(2.0 * kernels::kPi / width);
    const PlaneRows own(map, grid, pool);
    Image<float> roughness(width, height);
    const cpu::RoughnessJob rough{grid.tables(), map.depth.pixels().data(), own.view(), roughness.pixels().data()};
    Image<float> filtered = map.depth;
    pool.for_each(height, [&](int y) {
      executor.impl().rows.roughness_row(rough, y);
      CompareBuffers buffers(width);
      std::vector<Votes> votes(static_cast<std::size_t>(width));
      for (const cpu::CompareJob& job : jobs) {
        executor.impl().rows.compare_row(job, y, buffers.out());
        for (std::size_t x = 0; x < votes.size(); ++x) {
          votes[x].add(buffers.closeness[x], buffers.parallax_gain[x], tolerance);
        }
      }
      for (int x = 0; x < width; ++x) {
        const Votes& vote = votes[static_cast<std::size_t>(x)];
        map.confidence(x, y) =
            kernels::confidence_of_error(vote.expected_error(roughness(x, y), others.size(), pixel_angle));
        const bool kept = vote.agree >= wanted && (wanted == 0 || vote.agree > vote.contradict);
        if (!kept) filtered(x, y) = 0.0F;
      }
    });
    map.depth = std::move(filtered);
    clear_where_no_depth(map);
  }
  if (stats != nullptr) *stats = {before, count_depths(map)};
}

}  // namespace pmsp
