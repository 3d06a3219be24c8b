// SPDX-License-Identifier: BSD-2-Clause
#include <cstddef>
#include <unordered_map>

#include "plan/reach.h"
#include "pmsp/error.h"
#include "pmsp/plan.h"

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

Halo halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options) {
  if (options.init.warp_previous && options.init.chain_keyframes == 0 && !options.unordered) {
    throw InvalidOption(
        "init.chain_keyframes is 0: planes are handed on from keyframe to keyframe through the whole flight, so that "
        "every result depends on all keyframes before; expected 1 to 100000, or init.warp_previous off");
  }
  const HaloFinder find(plan);
  Set clouds = find.none();
  for (const std::int64_t id : ids) {
    const std::size_t i = find.index_of(id);
    clouds[i] = plan.entries[i].has_depth_map();
  }
  Set eligible = clouds;
  for (int round = 0; round < ownership_rounds(options); ++round) {
    const Set asking = eligible;
    find.follow(asking, &PlanEntry::owners, eligible);
  }
  Set sights = find.none();
  if (options.free_space.enabled) find.follow(eligible, &PlanEntry::viewers, sights);
  Set images = clouds;
  find.follow(clouds, &PlanEntry::fusion, images);
  Set filtered = eligible;  // and with them the clouds
  HaloFinder::add(filtered, sights);
  find.follow(eligible, &PlanEntry::fusion, filtered);
  Set planes = filtered;
  find.follow(filtered, &PlanEntry::consistency, planes);

  Halo result{find.ids(clouds), find.ids(eligible), find.ids(sights), find.ids(filtered), {}, {}};
  const int passes = options.patchmatch.geometric_passes;
  result.planes.resize(static_cast<std::size_t>(passes) + 1);
  for (int pass = passes; pass > 0; --pass) {
    result.planes[static_cast<std::size_t>(pass)] = find.ids(planes);
    Set lenders = find.none();
    find.follow(planes, &PlanEntry::near, lenders);
    find.each(lenders, [&](const PlanEntry& entry) {
      if (entry.has_depth_map()) planes[find.index_of(entry.id)] = true;
    });
  }
  find.each(planes, [&](const PlanEntry& entry) {
    for (auto source = entry.first_planes; source; source = plan.entries[find.index_of(*source)].first_planes) {
      planes[find.index_of(*source)] = true;
    }
  });
  result.planes[0] = find.ids(planes);
  HaloFinder::add(images, planes);  // every pass is among the first one's
  find.follow(planes, &PlanEntry::near, images);
  find.follow(planes, &PlanEntry::far, images);
  result.images = find.ids(images);
  return result;
}

}  // namespace pmsp
