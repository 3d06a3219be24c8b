// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <string>

#include "cpu/executor_impl.h"
#include "densifier_checks.h"
#include "filters/filter_setup.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "sphere/grid.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {

Image<float> consistency_filter(const PlaneMap& map, const std::vector<const PlaneMap*>& others,
                                const ConsistencyFilterOptions& options, const Executor& executor, FilterStats* stats,
                                double pose_error, double lens_distance) {
  options.validate();
  check_pose_error("consistency_filter: ", pose_error);
  if (others.size() > static_cast<std::size_t>(kernels::kMaxCompared)) {
    throw InvalidInput("consistency_filter: " + std::to_string(others.size()) + " other maps; expected at most " +
                       std::to_string(kernels::kMaxCompared));
  }
  check_scale("consistency_filter: ", map.scale);
  const SphereGrid grid(map.width(), map.height());
  Image<float> confidence(map.width(), map.height());
  Image<float> with_pose_error(map.width(), map.height());
  auto stage = consistency_stage<kernels::HostViewTypes>(view_of(map), grid.view(), others.size(), options, pose_error,
                                                         confidence.pixels().data(), with_pose_error.pixels().data());
  for (std::size_t k = 0; k < others.size(); ++k) {
    if (!same_size(*others[k], map)) throw InvalidInput("consistency_filter: the maps differ in size");
    check_scale("consistency_filter: ", others[k]->scale);
    stage.others[k] = {view_of(*others[k]),
                       relative_pose(others[k]->pose(), map.pose(), 0.5 * lens_distance).other_from_first};
  }
  const auto counts = impl_of(executor).run(stage);
  if (stats != nullptr) *stats = {counts[0], counts[1]};
  return with_pose_error;
}

}  // namespace pmsp
