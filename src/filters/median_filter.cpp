// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "pmsp/filters.h"

namespace pmsp {

void median_filter(DepthMap& map, const MedianFilterOptions& options, const Executor& executor, FilterStats* stats) {
  options.validate();
  const std::int64_t before = count_depths(map);
  if (options.enabled) {
    Image<float> filtered(map.depth.width(), map.depth.height());
    const cpu::MedianJob job{map.depth.width(),
                             map.depth.height(),
                             map.depth.pixels().data(),
                             map.confidence.pixels().data(),
                             static_cast<float>(options.max_relative_deviation),
                             static_cast<float>(options.min_score),
                             filtered.pixels().data()};
    executor.impl().pool.for_each(job.height, [&](int y) { executor.impl().rows.median_row(job, y); });
    map.depth = std::move(filtered);
    clear_where_no_depth(map);
  }
  if (stats != nullptr) *stats = {before, count_depths(map)};
}

}  // namespace pmsp
