// SPDX-License-Identifier: BSD-2-Clause
#include "plan/check_plan.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <sstream>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include "duplicates.h"
#include "plan/reach.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

namespace pmsp {
namespace {

constexpr const char* kOtherOptions = " with these options; was the plan made with others?";

/// List of an entry, with the limits of make_plan.
struct List {
  const char* name;
  std::vector<std::int64_t> PlanEntry::*ids;
  int most;             ///< maximum size; for valid options within the capacity of the kernels
  std::int64_t before;  ///< maximum distance before the entry [used keyframes]
  std::int64_t after;
  bool images_only;  ///< may contain keyframes without a depth map
};

std::vector<List> lists_of(const DensifierOptions& options) {
  const PlanReach reach = plan_reach(options);
  const int window = options.advanced.fusion.window - 1;
  const int max_viewers = std::min(kernels::kMaxViewers, window + options.advanced.free_space.views);
  return {{"near", &PlanEntry::near, options.advanced.patchmatch.neighbours, reach.near, reach.near, true},
          {"consistency", &PlanEntry::consistency,
           options.advanced.consistency.enabled ? options.advanced.consistency.window - 1 : 0, reach.consistency,
           reach.consistency, false},
          {"fusion", &PlanEntry::fusion, window, reach.fusion, reach.fusion, false},
          {"viewers", &PlanEntry::viewers, options.advanced.free_space.enabled ? max_viewers : window,
           reach.viewers_before, reach.viewers_after, false},
          {"duplicate_views", &PlanEntry::duplicate_views, searches_whole_mission(options) ? max_viewers : window,
           reach.duplicate_views, reach.duplicate_views, false}};
}

class PlanChecker {
 public:
  PlanChecker(const Plan& plan, const DensifierOptions& options) : options_(options) {
    std::int64_t place = 0;
    for (const PlanEntry& entry : plan.entries) {
      const bool is_new = entries_.emplace(entry.id, Placed{&entry, place}).second;
      if (!is_new) refuse(entry, "appears more than once; expected unique ids");
      if (entry.used()) ++place;
    }
  }

  void check(const PlanEntry& entry, const std::vector<List>& lists) const {
    for (const List& list : lists) check(entry, list);
    if (entry.near.empty()) refuse(entry, "has a depth map, but near is empty; expected at least one keyframe");
    if (entry.first_planes) check_first_planes(entry);
    const DepthRange& range = entry.range;
    if (range.min >= kMinDepth && range.max > range.min && range.max <= kMaxDepth) return;
    std::ostringstream text;
    text << "has a depth map, but its range is " << range.min << " to " << range.max << "; expected " << kMinDepth
         << " <= min < max <= " << kMaxDepth;
    refuse(entry, text.str());
  }

 private:
  struct Placed {
    const PlanEntry* entry;
    std::int64_t place;  ///< index among the used keyframes
  };

  [[noreturn]] static void refuse(const PlanEntry& entry, const std::string& why) {
    throw InvalidInput("the plan's keyframe " + std::to_string(entry.id) + " " + why);
  }

  [[noreturn]] static void refuse(const PlanEntry& entry, const char* list, std::int64_t named,
                                  const std::string& why) {
    refuse(entry, "names keyframe " + std::to_string(named) + " in " + list + why);
  }

  /// Returns the distance from `entry` to keyframe `id` of a list [used keyframes]; negative = before.
  std::int64_t distance(const PlanEntry& entry, const char* list, std::int64_t id, bool images_only) const {
    const auto found = entries_.find(id);
    if (found == entries_.end()) refuse(entry, list, id, ", which the plan lacks");
    if (id == entry.id) refuse(entry, list, id, ", itself");
    const PlanEntry& named = *found->second.entry;
    if (!(images_only ? named.used() : named.has_depth_map())) {
      refuse(entry, list, id, images_only ? ", which is not used" : ", which has no depth map");
    }
    return found->second.place - entries_.at(entry.id).place;
  }

  void check(const PlanEntry& entry, const List& list) const {
    const std::vector<std::int64_t>& ids = entry.*list.ids;
    if (ids.size() > static_cast<std::size_t>(list.most)) {
      refuse(entry, "names " + std::to_string(ids.size()) + " keyframes in " + list.name + "; expected at most " +
                        std::to_string(list.most) + kOtherOptions);
    }
    std::unordered_set<std::int64_t> before;
    for (const std::int64_t id : ids) {
      const std::int64_t away = distance(entry, list.name, id, list.images_only);
      if (!before.insert(id).second) refuse(entry, list.name, id, " twice");
      if (options_.unordered || (away >= -list.before && away <= list.after)) continue;
      refuse(entry, list.name, id,
             ", " + std::to_string(std::abs(away)) + " used keyframes " + (away < 0 ? "before" : "after") +
                 " it; expected at most " + std::to_string(away < 0 ? list.before : list.after) + kOtherOptions);
    }
  }

  void check_first_planes(const PlanEntry& entry) const {
    const std::int64_t id = *entry.first_planes;
    const std::int64_t away = distance(entry, "first_planes", id, false);
    const bool warps = options_.advanced.init.warp_previous && !options_.unordered;
    if (warps && away == -1) return;
    refuse(entry, "first_planes", id,
           std::string("; expected ") + (warps ? "the previous used keyframe" : "none") + kOtherOptions);
  }

  const DensifierOptions& options_;
  std::unordered_map<std::int64_t, Placed> entries_;  ///< by id
};

}  // namespace

void check_plan(const Plan& plan, const DensifierOptions& options) {
  const PlanChecker checker(plan, options);
  const std::vector<List> lists = lists_of(options);
  for (const PlanEntry& entry : plan.entries) {
    if (entry.has_depth_map()) checker.check(entry, lists);
  }
}

}  // namespace pmsp
