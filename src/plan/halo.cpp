// SPDX-License-Identifier: BSD-2-Clause
#include "plan/halo.h"

#include <cstddef>
#include <string>
#include <unordered_map>

#include "plan/reach.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Which keyframes of a plan have an artefact, by index.
using Set = std::vector<bool>;

class HaloFinder {
 public:
  explicit HaloFinder(const Plan& plan) : plan_(plan) {
    for (std::size_t i = 0; i < plan.entries.size(); ++i) index_of_.emplace(plan.entries[i].id, i);
  }

  std::size_t index_of(std::int64_t id) const {
    const auto found = index_of_.find(id);
    if (found == index_of_.end()) {
      throw InvalidInput("the plan has no keyframe " + std::to_string(id) + ", or names one that it lacks");
    }
    return found->second;
  }

  Set none() const { return Set(plan_.entries.size(), false); }
  void add(Set& set, const std::vector<std::int64_t>& ids) const {
    for (const std::int64_t id : ids) set[index_of(id)] = true;
  }
  static void add(Set& set, const Set& others) {
    for (std::size_t i = 0; i < set.size(); ++i) set[i] = set[i] || others[i];
  }

  /// Calls `visit` with each entry of the set.
  template <class Visit>
  void each(const Set& set, const Visit& visit) const {
    for (std::size_t i = 0; i < set.size(); ++i) {
      if (set[i]) visit(plan_.entries[i]);
    }
  }
  /// What the entries of `from` name in one of their lists joins `to`, another set.
  void follow(const Set& from, std::vector<std::int64_t> PlanEntry::*list, Set& to) const {
    each(from, [&](const PlanEntry& entry) { add(to, entry.*list); });
  }

  std::vector<std::int64_t> ids(const Set& set) const {
    std::vector<std::int64_t> result;
    each(set, [&](const PlanEntry& entry) { result.push_back(entry.id); });
    return result;
  }

 private:
  const Plan& plan_;
  std::unordered_map<std::int64_t, std::size_t> index_of_;
};

}  // namespace

void refuse_endless_chain(const DensifierOptions& options) {
  if (!options.init.warp_previous || options.init.chain_keyframes != 0 || options.unordered) return;
  throw InvalidOption(
      "init.chain_keyframes is 0: planes are handed on from keyframe to keyframe through the whole flight, so that "
      "every result depends on all keyframes before; expected 1 to 100000, or init.warp_previous off");
}

Halo find_halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options, bool points) {
  const HaloFinder find(plan);
  Set asked = find.none();
  for (const std::int64_t id : ids) {
    const std::size_t i = find.index_of(id);
    asked[i] = plan.entries[i].has_depth_map();
  }
  Halo result;
  Set made = points ? asked : find.none();  // points
  result.clouds = find.ids(made);
  result.rounds.resize(static_cast<std::size_t>(ownership_rounds(options)) + 1);
  for (std::size_t round = result.rounds.size() - 1; round > 0; --round) {
    result.rounds[round] = find.ids(made);
    const Set asking = made;
    find.follow(asking, &PlanEntry::owners, made);
  }
  result.rounds[0] = find.ids(made);
  Set sights = find.none();
  if (options.free_space.enabled) find.follow(made, &PlanEntry::viewers, sights);
  result.sights = find.ids(sights);
  Set filtered = asked;
  HaloFinder::add(filtered, made);
  HaloFinder::add(filtered, sights);
  find.follow(made, &PlanEntry::fusion, filtered);
  result.filtered = find.ids(filtered);
  Set planes = filtered;
  find.follow(filtered, &PlanEntry::consistency, planes);
  result.planes.resize(static_cast<std::size_t>(options.patchmatch.geometric_passes) + 1);
  for (std::size_t pass = result.planes.size() - 1; pass > 0; --pass) {
    result.planes[pass] = find.ids(planes);
    Set lenders = find.none();
    find.follow(planes, &PlanEntry::near, lenders);
    find.each(lenders, [&](const PlanEntry& entry) {
      if (entry.has_depth_map()) planes[find.index_of(entry.id)] = true;
    });
  }
  find.each(planes, [&](const PlanEntry& entry) {
    for (auto source = entry.first_planes; source; source = plan.entries[find.index_of(*source)].first_planes) {
      if (planes[find.index_of(*source)]) break;  // whose chain is followed on its own
      planes[find.index_of(*source)] = true;
    }
  });
  result.planes[0] = find.ids(planes);
  Set images = planes;
  find.follow(planes, &PlanEntry::near, images);
  find.follow(planes, &PlanEntry::far, images);
  result.images = find.ids(images);
  return result;
}

Halo halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options, bool points) {
  refuse_endless_chain(options);
  return find_halo(plan, ids, options, points);
}

}  // namespace pmsp
