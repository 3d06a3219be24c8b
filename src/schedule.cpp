// SPDX-License-Identifier: BSD-2-Clause
#include "schedule.h"

#include <algorithm>
#include <utility>

#include "plan/reach.h"

namespace pmsp {

double Stage::cost() const {
  switch (kind) {
    case Kind::kMatch:
      return 1.0;
    case Kind::kFilter:
    case Kind::kFuse:
      return 0.1;
    case Kind::kFreeSpace:
    case Kind::kDuplicates:
    case Kind::kEmit:
      return 0.05;
  }
  return 0.0;
}

Schedule::Schedule(const DensifierOptions& options, bool points) {
  using Kind = Stage::Kind;
  const PlanReach reach = plan_reach(options);
  std::size_t matched = 0;
  for (int pass = 0; pass <= options.advanced.patchmatch.geometric_passes; ++pass) {
    std::vector<Stage::Prerequisite> needs;
    if (pass > 0) needs.push_back({matched, reach.near});
    matched = add(Kind::kMatch, pass, std::move(needs), reach.near);
  }
  const std::size_t filtered = add(Kind::kFilter, 0, {{matched, reach.consistency}}, reach.near + reach.windows);
  add_lifetime(Artefact::kImage, 0, {{matched, reach.near}});
  add_lifetime(Artefact::kLandmarks, 0, {{0, 0}});
  add_lifetime(Artefact::kPassPlanes, stages_.front().lookahead, {{matched, reach.near}});
  const std::int64_t last_match = stages_[matched].lookahead;
  std::vector<Lifetime::Reader> final_plane_readers{{filtered, reach.consistency}};
  if (matched == 0 && options.advanced.init.warp_previous)
    final_plane_readers.push_back({0, 1});  // planes of the only pass are warped, too
  if (!points) {
    add_lifetime(Artefact::kColor, 0, {{matched, 0}});
    add_lifetime(Artefact::kFinalPlanes, last_match, std::move(final_plane_readers));
    add_lifetime(Artefact::kFiltered, stages_[filtered].lookahead, {{filtered, 0}});
    return;
  }
  const std::size_t fused = add(Kind::kFuse, 0, {{filtered, reach.fusion}}, 0);
  add_lifetime(Artefact::kColor, 0, {{fused, reach.fusion}, {matched, 0}});  // keyframes of a halo may not be fused
  final_plane_readers.push_back({fused, reach.fusion});
  add_lifetime(Artefact::kFinalPlanes, last_match, std::move(final_plane_readers));
  add_lifetime(Artefact::kFiltered, stages_[filtered].lookahead, {{fused, reach.fusion}});
  std::size_t decided = fused;
  if (options.advanced.free_space.enabled) {
    decided = add(Kind::kFreeSpace, 0, {{fused, 0}, {filtered, reach.viewers_after}}, reach.near + reach.viewers_after);
    add_lifetime(Artefact::kRangeMap, stages_[filtered].lookahead, {{decided, reach.viewers_before}});
  }
  const int rounds = duplicate_rounds(options);
  for (int round = 1; round <= rounds; ++round) {
    decided = add(Kind::kDuplicates, round, {{decided, reach.duplicate_views}}, reach.near + reach.viewers_after);
  }
  const std::size_t emitted = add(Kind::kEmit, 0, {{decided, 0}}, 0);
  add_lifetime(Artefact::kSurfels, stages_[fused].lookahead,
               {{decided, rounds > 0 ? reach.duplicate_views : 0}, {emitted, 0}});
}

std::size_t Schedule::add(Stage::Kind kind, int step, std::vector<Stage::Prerequisite> needs,
                          std::int64_t plan_lookahead) {
  std::int64_t lookahead = plan_lookahead;
  for (const Stage::Prerequisite& need : needs)
    lookahead = std::max(lookahead, stages_[need.stage].lookahead + need.ahead);
  stages_.push_back({kind, step, std::move(needs), lookahead});
  return stages_.size() - 1;
}

void Schedule::add_lifetime(Artefact artefact, std::int64_t produced, std::vector<Lifetime::Reader> readers) {
  std::int64_t until = produced;
  for (const Lifetime::Reader& reader : readers)
    until = std::max(until, stages_[reader.stage].lookahead + reader.behind);
  lifetimes_.push_back({artefact, std::move(readers), until - produced + 1});
}

const Lifetime* Schedule::lifetime(Artefact artefact) const {
  const auto found = std::find_if(lifetimes_.begin(), lifetimes_.end(),
                                  [&](const Lifetime& lifetime) { return lifetime.artefact == artefact; });
  return found == lifetimes_.end() ? nullptr : &*found;
}

}  // namespace pmsp
