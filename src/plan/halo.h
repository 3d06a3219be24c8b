// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <vector>

#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/api.h"
#include "pmsp/options.h"

namespace pmsp {

/// Results requested from a run. Each depends on all inputs of the previous one, and more.
enum class Wanted { kPlanes, kDepthMaps, kPoints };

/// Halo with planes of an earlier run: fewer keyframes are matched; `planes` lists those with a pass.
struct RunHalo : Halo {
  std::vector<std::int64_t> earlier;  ///< keyframes whose earlier planes are read
};

/// `options`: those of the plan. `clouds`, `rounds` and `range_maps` only of points. Throws InvalidInput if the plan
/// lacks one of `ids` or a listed keyframe.
RunHalo find_halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options,
                  Wanted wanted, const std::map<std::int64_t, PlaneReuse>& reuses = {});

/// Keyframes whose planes determine the points of a keyframe, for many queries: as find_halo with the planes of all
/// keyframes from an earlier run.
class PMSP_API PointsHalo {
 public:
  /// `plan` and `options` must outlive it.
  PointsHalo(const Plan& plan, const DensifierOptions& options);

  /// Returns keyframes in the order of the plan, including `id`, which must have a depth map.
  std::vector<std::int64_t> planes_of(std::int64_t id) const;
  const PlanEntry& entry(std::int64_t id) const { return plan_.entries[entry_index_by_id_.at(id)]; }

 private:
  const Plan& plan_;
  const DensifierOptions& options_;
  std::unordered_map<std::int64_t, std::size_t> entry_index_by_id_;
};

/// Passes of a keyframe, from the first to the last one; none if last < first.
struct PassRange {
  int first, last;
};
/// `reuse`: nullptr = none. `passes`: number of geometric passes.
PassRange pass_range(const PlaneReuse* reuse, int passes);

}  // namespace pmsp
