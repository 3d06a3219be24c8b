// SPDX-License-Identifier: BSD-2-Clause
#include "plan/halo.h"

#include <cstddef>
#include <set>
#include <string>
#include <unordered_map>

#include "plan/reach.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Keyframes of a plan that have an artefact, by index.
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
  /// Adds the keyframes in a list of the entries of `from` to `to`, another set.
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

void check_chain(const DensifierOptions& options) {
  if (!options.advanced.init.warp_previous || options.advanced.init.chain_keyframes != 0 || options.unordered) return;
  throw InvalidOption(
      "init.chain_keyframes is 0; expected 1 to 100000, or init.warp_previous off: planes are warped from keyframe to "
      "keyframe through the whole mission, so that every result depends on all previous keyframes");
}

PassRange pass_range(const PlaneReuse* reuse, int passes) {
  if (reuse == nullptr) return {0, passes};
  if (reuse->planes == PlaneReuse::Planes::kStart) return {passes + 1 - reuse->passes, passes};
  return {0, reuse->passes - 1};
}

RunHalo find_halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options,
                  Wanted wanted, const std::map<std::int64_t, PlaneReuse>& reuses) {
  const HaloFinder find(plan);
  const int passes = options.advanced.patchmatch.geometric_passes;
  const auto reuse_of = [&](std::int64_t id) {
    const auto found = reuses.find(id);
    return found == reuses.end() ? nullptr : &found->second;
  };
  const auto runs = [&](const PlanEntry& entry, int pass) {
    const PlaneReuse* const reuse = reuse_of(entry.id);
    const PassRange range = pass_range(reuse, passes);
    const bool is_there = reuse != nullptr && reuse->planes == PlaneReuse::Planes::kResult && pass == range.last;
    return entry.has_depth_map() && !is_there && pass >= range.first && pass <= range.last;
  };
  /// Whether the map after a pass is from an earlier run.
  const auto is_earlier = [&](const PlanEntry& entry, int pass) {
    const PlaneReuse* const reuse = reuse_of(entry.id);
    if (reuse == nullptr || reuse->planes == PlaneReuse::Planes::kNone) return false;
    const PassRange range = pass_range(reuse, passes);
    return reuse->planes == PlaneReuse::Planes::kStart ? pass < range.first : pass >= range.last;
  };
  Set asked = find.none();
  for (const std::int64_t id : ids) {
    const std::size_t i = find.index_of(id);
    asked[i] = plan.entries[i].has_depth_map();
  }
  RunHalo result;
  Set made = wanted == Wanted::kPoints ? asked : find.none();  // keyframes whose points are needed
  result.clouds = find.ids(made);
  result.rounds.resize(static_cast<std::size_t>(duplicate_rounds(options)) + 1);
  for (std::size_t round = result.rounds.size() - 1; round > 0; --round) {
    result.rounds[round] = find.ids(made);
    const Set asking = made;
    find.follow(asking, &PlanEntry::duplicate_views, made);
  }
  result.rounds[0] = find.ids(made);
  Set range_maps = find.none();
  if (options.advanced.free_space.enabled) find.follow(made, &PlanEntry::viewers, range_maps);
  result.range_maps = find.ids(range_maps);
  Set filtered = wanted == Wanted::kPlanes ? find.none() : asked;
  HaloFinder::add(filtered, made);
  HaloFinder::add(filtered, range_maps);
  find.follow(made, &PlanEntry::fusion, filtered);
  result.filtered = find.ids(filtered);
  Set planes = asked;  // needed after the current pass
  HaloFinder::add(planes, filtered);
  find.follow(filtered, &PlanEntry::consistency, planes);
  Set there = find.none();  // from an earlier run
  Set matched = find.none();
  result.planes.resize(static_cast<std::size_t>(passes) + 1);
  for (int pass = passes; pass >= 0; --pass) {
    if (pass == 0) {  // sources of warped planes, recursively
      const Set starting = planes;
      find.each(starting, [&](const PlanEntry& entry) {
        for (const PlanEntry* at = &entry; at->first_planes && runs(*at, 0);) {
          at = &plan.entries[find.index_of(*at->first_planes)];
          if (planes[find.index_of(at->id)]) break;  // its chain is followed separately
          planes[find.index_of(at->id)] = true;
        }
      });
    }
    Set running = find.none();
    Set before = find.none();  // needed after the previous pass
    Set lenders = find.none();
    find.each(planes, [&](const PlanEntry& entry) {
      const std::size_t i = find.index_of(entry.id);
      if (is_earlier(entry, pass)) {
        there[i] = true;
        return;
      }
      before[i] = true;
      if (!runs(entry, pass)) return;  // its passes are complete
      running[i] = true;
      const PlaneReuse* const reuse = reuse_of(entry.id);
      const bool photometric = reuse != nullptr && reuse->photometric_first && pass == pass_range(reuse, passes).first;
      if (!photometric) find.add(lenders, entry.near);
    });
    result.planes[static_cast<std::size_t>(pass)] = find.ids(running);
    HaloFinder::add(matched, running);
    planes = before;
    find.each(lenders, [&](const PlanEntry& entry) {
      if (entry.has_depth_map()) planes[find.index_of(entry.id)] = true;
    });
  }
  result.earlier = find.ids(there);
  Set images = matched;
  find.follow(matched, &PlanEntry::near, images);
  HaloFinder::add(images, filtered);
  HaloFinder::add(images, there);
  result.images = find.ids(images);
  return result;
}

PointsHalo::PointsHalo(const Plan& plan, const DensifierOptions& options) : plan_(plan), options_(options) {
  for (std::size_t place = 0; place < plan.entries.size(); ++place)
    entry_index_by_id_.emplace(plan.entries[place].id, place);
}

std::vector<std::int64_t> PointsHalo::planes_of(std::int64_t id) const {
  using Places = std::set<std::size_t>;
  const auto follow = [&](const Places& from, std::vector<std::int64_t> PlanEntry::*list, Places& to) {
    for (const std::size_t place : from) {
      for (const std::int64_t named : plan_.entries[place].*list) to.insert(entry_index_by_id_.at(named));
    }
  };
  Places made{entry_index_by_id_.at(id)};
  for (int round = duplicate_rounds(options_); round > 0; --round) {
    const Places asking = made;
    follow(asking, &PlanEntry::duplicate_views, made);
  }
  Places filtered = made;
  if (options_.advanced.free_space.enabled) follow(made, &PlanEntry::viewers, filtered);
  follow(made, &PlanEntry::fusion, filtered);
  Places planes = filtered;
  follow(filtered, &PlanEntry::consistency, planes);
  std::vector<std::int64_t> ids;
  for (const std::size_t place : planes) ids.push_back(plan_.entries[place].id);
  return ids;
}

}  // namespace pmsp
