// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <unordered_map>
#include <vector>

#include "plan/halo.h"
#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/options.h"
#include "schedule.h"

namespace pmsp {

/// Part of a plan that the results of some keyframes depend on: participating keyframes and their stages.
/// Keyframes are numbered by the index of their entry.
class PlanPart {
 public:
  /// `options`: valid. Throws InvalidInput as check_plan does, if the plan lacks one of `ids`, or if reuses are
  /// unsuitable; InvalidOption if the chain of first planes is unlimited and `ids` are not all keyframes.
  PlanPart(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options, Wanted wanted,
           const std::map<std::int64_t, PlaneReuse>& reuses = {});

  /// Throws InvalidInput if the plan lacks the keyframe.
  std::size_t entry_index_of(std::int64_t id) const;
  const PlanEntry& entry(std::size_t entry_index) const { return plan_.entries[entry_index]; }

  /// Entry indices of participating keyframes, in the order of the plan.
  const std::vector<std::size_t>& required() const { return taking_part_; }
  bool takes_part(std::size_t entry_index) const { return planned_stages_[entry_index].takes_part; }
  /// Whether results of the keyframe are requested.
  bool emits(std::size_t entry_index) const { return planned_stages_[entry_index].emits_results; }
  bool runs(const Stage& stage, std::size_t entry_index) const;

  /// Matching of the keyframe with fewer passes; ignored unless `needs_earlier`.
  const std::optional<PlaneReuse>& reuse(std::size_t entry_index) const { return planned_stages_[entry_index].reuse; }
  bool needs_earlier(std::size_t entry_index) const { return planned_stages_[entry_index].earlier; }

 private:
  /// Stages of a keyframe.
  struct PlannedStages {
    bool takes_part = false;   ///< with its image at least
    std::uint32_t passes = 0;  ///< bit p: pass p of PatchMatch
    std::optional<PlaneReuse> reuse;
    bool earlier = false;  ///< its planes of an earlier run are read
    bool filtered = false;
    int rounds = -1;  ///< of duplicate removal; 0 = up to the free-space test, -1 = no points
    bool emits_results = false;
  };

  Plan plan_;
  std::unordered_map<std::int64_t, std::size_t> entry_index_by_id_;  ///< by id
  std::vector<PlannedStages> planned_stages_;                        ///< by entry index
  std::vector<std::size_t> taking_part_;
};

}  // namespace pmsp
