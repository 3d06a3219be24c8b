// SPDX-License-Identifier: BSD-2-Clause
#include "plan/plan_part.h"

#include <algorithm>
#include <string>

#include "plan/check_plan.h"
#include "plan/halo.h"
#include "pmsp/error.h"

namespace pmsp {

PlanPart::PlanPart(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options,
                   Wanted wanted, const std::map<std::int64_t, PlaneReuse>& reuses)
    : plan_(plan), planned_stages_(plan.entries.size()) {
  check_plan(plan, options);
  for (std::size_t entry_index = 0; entry_index < plan.entries.size(); ++entry_index)
    entry_index_by_id_.emplace(plan.entries[entry_index].id, entry_index);
  for (const auto& [id, reuse] : reuses) {
    const int fewest = reuse.planes == PlaneReuse::Planes::kStart ? 0 : 1;
    const int most = options.advanced.patchmatch.geometric_passes + (fewest == 0 ? 0 : 1);
    if (reuse.passes < fewest || reuse.passes > most) {
      throw InvalidInput("keyframe " + std::to_string(id) + " is to be matched in " + std::to_string(reuse.passes) +
                         " passes; expected " + std::to_string(fewest) + " to " + std::to_string(most));
    }
    planned_stages_[entry_index_of(id)].reuse = reuse;
  }
  const RunHalo halo = find_halo(plan, ids, options, wanted, reuses);
  for (const std::int64_t id : ids) planned_stages_[entry_index_of(id)].emits_results = true;
  for (std::size_t entry_index = 0; entry_index < planned_stages_.size(); ++entry_index) {
    const bool is_omitted = entry(entry_index).has_depth_map() && !planned_stages_[entry_index].emits_results;
    if (is_omitted && reuses.empty()) check_chain(options);  // planes of an earlier run end the chain
  }
  const auto each = [&](const std::vector<std::int64_t>& named, const auto& mark) {
    for (const std::int64_t id : named) mark(planned_stages_[entry_index_by_id_.at(id)]);
  };
  each(halo.images, [](PlannedStages& stages) { stages.takes_part = true; });
  for (std::size_t pass = 0; pass < halo.planes.size(); ++pass) {
    each(halo.planes[pass], [&](PlannedStages& stages) { stages.passes |= 1U << pass; });
  }
  each(halo.earlier, [](PlannedStages& stages) { stages.earlier = true; });
  each(halo.filtered, [](PlannedStages& stages) { stages.filtered = true; });
  for (const auto& round : halo.rounds) each(round, [](PlannedStages& stages) { ++stages.rounds; });
  for (std::size_t entry_index = 0; entry_index < planned_stages_.size(); ++entry_index) {
    if (planned_stages_[entry_index].takes_part) taking_part_.push_back(entry_index);
  }
}

std::size_t PlanPart::entry_index_of(std::int64_t id) const {
  const auto found = entry_index_by_id_.find(id);
  if (found == entry_index_by_id_.end()) throw InvalidInput("the plan has no keyframe " + std::to_string(id));
  return found->second;
}

bool PlanPart::runs(const Stage& stage, std::size_t entry_index) const {
  const PlannedStages& stages = planned_stages_[entry_index];
  switch (stage.kind) {
    case Stage::Kind::kMatch:
      return (stages.passes >> static_cast<unsigned>(stage.step) & 1U) != 0;
    case Stage::Kind::kFilter:
      return stages.filtered;
    case Stage::Kind::kFuse:
    case Stage::Kind::kFreeSpace:
    case Stage::Kind::kDuplicates:
      return stage.step <= stages.rounds;
    case Stage::Kind::kEmit:
      break;
  }
  return stages.emits_results;
}

}  // namespace pmsp
