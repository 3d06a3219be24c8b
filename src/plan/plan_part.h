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

/// The part of a plan that the results of some keyframes depend on: which keyframes take part, and how far each of them
/// goes. A keyframe's place is the index of its entry.
class PlanPart {
 public:
  /// `options`: valid. Throws InvalidInput as check_plan does, or when
  /// the plan lacks one of `ids`; InvalidOption where first planes form a chain without end and `ids` are not all.
  /// Throws InvalidInput, too, where shortcuts do not fit.
  PlanPart(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options, Wanted wanted,
           const std::map<std::int64_t, Shortcut>& shortcuts = {});

  /// Throws InvalidInput when the plan lacks the keyframe.
  std::size_t place_of(std::int64_t id) const;
  const PlanEntry& entry(std::size_t place) const { return plan_.entries[place]; }

  /// Places of the keyframes that take part, in the order of the plan.
  const std::vector<std::size_t>& taking_part() const { return taking_part_; }
  bool takes_part(std::size_t place) const { return ways_[place].takes_part; }
  /// Whether the keyframe's results are asked for.
  bool emits(std::size_t place) const { return ways_[place].emits_results; }
  bool runs(const Stage& stage, std::size_t place) const;

  /// How a keyframe is matched in less than all passes. Nobody looks at what is not `needs_earlier`.
  const std::optional<Shortcut>& shortcut(std::size_t place) const { return ways_[place].shortcut; }
  bool needs_earlier(std::size_t place) const { return ways_[place].earlier; }

 private:
  /// How far a keyframe goes.
  struct Way {
    bool takes_part = false;   ///< its image, if no more
    std::uint32_t passes = 0;  ///< bit p: pass p of PatchMatch
    std::optional<Shortcut> shortcut;
    bool earlier = false;  ///< its planes of an earlier run are looked at
    bool filtered = false;
    int rounds = -1;  ///< of ownership; 0 = its points are made and judged only, -1 = not even that
    bool emits_results = false;
  };

  Plan plan_;
  std::unordered_map<std::int64_t, std::size_t> places_;  ///< by id
  std::vector<Way> ways_;                                 ///< by place
  std::vector<std::size_t> taking_part_;
};

}  // namespace pmsp
