// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <vector>

#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/options.h"
#include "util/io_api.h"

namespace pmsp {

/// What a run hands out of the keyframes asked for. Each depends on all that the one before depends on, and more.
enum class Wanted { kPlanes, kDepthMaps, kPoints };

/// With planes of an earlier run fewer keyframes are matched; `planes` names those that a pass is run on.
struct RunHalo : Halo {
  std::vector<std::int64_t> earlier;  ///< those whose earlier planes are looked at
};

/// As `halo`, however long that chain is.
RunHalo find_halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options,
                  Wanted wanted, const std::map<std::int64_t, Shortcut>& shortcuts = {});

/// Whose planes the points of keyframes depend on, for asking about many of them: as find_halo with the planes of all
/// keyframes from an earlier run.
class PMSP_IO_API PointsHalo {
 public:
  /// Both must outlive it.
  PointsHalo(const Plan& plan, const DensifierOptions& options);

  /// In the order of the plan, itself included. Of a keyframe with a depth map.
  std::vector<std::int64_t> planes_of(std::int64_t id) const;
  const PlanEntry& entry(std::int64_t id) const { return plan_.entries[places_.at(id)]; }

 private:
  const Plan& plan_;
  const DensifierOptions& options_;
  std::unordered_map<std::int64_t, std::size_t> places_;
};

/// Which passes a keyframe is matched in, from the first to the last one; none where the last one comes first.
struct PassRange {
  int first, last;
};
/// `shortcut`: nullptr = none. `passes`: geometric ones.
PassRange pass_range(const Shortcut* shortcut, int passes);

}  // namespace pmsp
