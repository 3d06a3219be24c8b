// SPDX-License-Identifier: BSD-2-Clause
#include "plan/choices.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>
#include <utility>

#include "duplicates.h"
#include "patchmatch/neighbours.h"

namespace pmsp {
namespace {

constexpr double kRangeReach = 2.0;     ///< factor on the 90th percentile of the ranges of a keyframe's landmarks
constexpr double kRangeMargin = 1.1;    ///< maximum ratio of the ends of depth ranges that count as equal
constexpr double kSpreadToStay = 0.75;  ///< minimum share of the intervals, and of the possible viewers

double reach_of(const Keyframe& keyframe) {
  std::vector<double> ranges;
  ranges.reserve(keyframe.landmarks.size());
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  for (const Landmark& landmark : keyframe.landmarks) ranges.push_back((landmark.position_world - center).norm());
  if (ranges.empty()) return 0.0;
  const auto at = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() * 9 / 10);
  std::nth_element(ranges.begin(), at, ranges.end());
  return kRangeReach * *at;
}

/// Whether the previous viewers are nearly as many as possible and spread over the whole list: divided into half as
/// many intervals as wanted viewers, most of these contain one. Candidates at the border of the reach are ignored.
bool still_spread(const std::vector<std::int64_t>& viewers, const std::vector<ViewerCandidate>& list,
                  std::size_t wanted, double surely_within) {
  const std::unordered_set<std::int64_t> known(viewers.begin(), viewers.end());
  const std::size_t intervals = (std::min(wanted, list.size()) + 1) / 2;
  std::size_t viewers_known = 0;
  std::size_t candidates = 0;
  double with_viewer = 0.0;
  double with_candidate = 0.0;
  for (std::size_t i = 0; i < intervals; ++i) {
    std::size_t viewers_here = 0;
    std::size_t candidates_here = 0;
    for (std::size_t k = i * list.size() / intervals; k < (i + 1) * list.size() / intervals; ++k) {
      viewers_here += known.count(list[k].id);
      candidates_here += known.count(list[k].id) != 0 || list[k].distance <= surely_within ? 1 : 0;
    }
    with_viewer += viewers_here > 0 ? 1.0 : 0.0;
    with_candidate += candidates_here > 0 ? 1.0 : 0.0;
    viewers_known += viewers_here;
    candidates += candidates_here;
  }
  const double possible = static_cast<double>(std::min(wanted, candidates));
  return with_viewer >= kSpreadToStay * with_candidate &&
         static_cast<double>(viewers_known) >= kSpreadToStay * possible;
}

}  // namespace

PlanNode::PlanNode(PlanKeyframe&& given, std::size_t index) : entry(index) {
  keyframe.id = given.id;
  keyframe.cam_from_world = given.cam_from_world;
  keyframe.landmarks = std::move(given.landmarks);
  center = keyframe.cam_from_world.center();
  reach = reach_of(keyframe);
}

PreviousPlan::PreviousPlan(const Plan* plan) {
  if (plan == nullptr) return;
  for (const PlanEntry& entry : plan->entries) entries_.emplace(entry.id, entry);
}

const PlanEntry* PreviousPlan::find(std::int64_t id) const {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second;
}

ViewChain::Preference PreviousPlan::preference(std::int64_t id) const {
  const PlanEntry* entry = find(id);
  if (entry == nullptr) return ViewChain::Preference::kNone;
  return entry->used() ? ViewChain::Preference::kUse : ViewChain::Preference::kReject;
}

std::vector<std::int64_t> choose_viewers(const PlanNode& node, const std::vector<std::int64_t>& window,
                                         const std::vector<ViewerCandidate>& candidates, int count,
                                         const std::vector<std::int64_t>* before) {
  const std::unordered_set<std::int64_t> in_window(window.begin(), window.end());
  const std::size_t wanted =
      std::min(static_cast<std::size_t>(count), static_cast<std::size_t>(kernels::kMaxViewers) - window.size());
  std::vector<ViewerCandidate> list;  // within reach, without the window
  std::unordered_set<std::int64_t> allowed;
  for (const ViewerCandidate& candidate : candidates) {
    const bool known = in_window.count(candidate.id) != 0;
    if (known || candidate.distance <= kReachMargin * node.reach) allowed.insert(candidate.id);
    if (!known && candidate.distance <= node.reach) list.push_back(candidate);
  }
  if (before != nullptr) {
    std::size_t of_window = 0;
    bool all_allowed = true;
    for (const std::int64_t id : *before) {
      all_allowed = all_allowed && allowed.count(id) != 0;
      of_window += in_window.count(id);
    }
    if (all_allowed && of_window == window.size() && before->size() <= window.size() + wanted &&
        still_spread(*before, list, wanted, node.reach / kReachMargin)) {
      return *before;
    }
  }
  std::unordered_set<std::int64_t> chosen(in_window);
  const std::size_t taken = std::min(wanted, list.size());
  for (std::size_t i = 0; i < taken; ++i) chosen.insert(list[(2 * i + 1) * list.size() / (2 * taken)].id);
  std::vector<std::int64_t> result;
  for (const ViewerCandidate& candidate : candidates) {
    if (chosen.count(candidate.id) != 0) result.push_back(candidate.id);
  }
  return result;
}

DepthRange choose_range(const Keyframe& keyframe, const InitOptions& options, const PlanEntry* previous) {
  const DepthRange range = depth_range(keyframe, options);
  if (previous == nullptr) return range;
  const auto hardly_differs = [](double a, double b) {
    return a > 0.0 && b > 0.0 && std::max(a / b, b / a) <= kRangeMargin;
  };
  const DepthRange& before = previous->range;
  return hardly_differs(range.min, before.min) && hardly_differs(range.max, before.max) ? before : range;
}

std::vector<std::size_t> indices_of(const std::vector<std::int64_t>& ids, const IndexById& candidates) {
  std::vector<std::size_t> result;
  for (const std::int64_t id : ids) {
    const auto found = candidates.find(id);
    if (found == candidates.end()) return {};
    result.push_back(found->second);
  }
  return result;
}

std::vector<std::size_t> choose_near(const std::vector<const Keyframe*>& sequence, std::size_t reference, int count,
                                     const PlanEntry* previous) {
  const std::vector<std::size_t> chosen = choose_neighbours(sequence, reference, count);
  if (previous == nullptr) return chosen;
  IndexById places;
  for (std::size_t i = 0; i < sequence.size(); ++i) places.emplace(sequence[i]->id, i);
  const std::vector<std::size_t> before = indices_of(previous->near, places);
  if (before.size() != chosen.size()) return chosen;
  std::ptrdiff_t later = 0;  // numbers of later keyframes must be equal
  for (const std::size_t i : before) later += i > reference ? 1 : 0;
  for (const std::size_t i : chosen) later -= i > reference ? 1 : 0;
  if (later != 0) return chosen;
  const auto value = [&](const std::vector<std::size_t>& list) {
    double sum = 0.0;
    for (const std::size_t i : list) sum += neighbour_usefulness(*sequence[reference], *sequence[i]);
    return sum;
  };
  return value(before) >= kNearlyAsGood * value(chosen) ? before : chosen;
}

void set_use_and_range(PlanEntry& entry, const DepthRange& range) {
  entry.range = range;
  if (entry.near.empty()) {
    entry.use = KeyframeUse::kNoNeighbour;
  } else if (!(range.max > range.min)) {
    entry.use = KeyframeUse::kNoRange;
  } else {
    entry.use = KeyframeUse::kDepthMap;
  }
}

}  // namespace pmsp
