// SPDX-License-Identifier: BSD-2-Clause
#include "plan/unordered.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "patchmatch/neighbours.h"
#include "plan/covisibility.h"
#include "plan/reach.h"
#include "util/median_of.h"
#include "view_filter/sharpness.h"

namespace pmsp {
namespace {

constexpr std::size_t kFewestNear = 2;
constexpr double kMinShareOfOthers = 0.5;     ///< usefulness of a further source view, relative to the first choice
constexpr std::size_t kMostSharers = 32;      ///< candidates for source views and windows
constexpr std::size_t kSharpnessOf = 3;       ///< keyframes whose sharpness is compared
constexpr double kSharedToSkipBlurred = 0.5;  ///< minimum share of a blurred keyframe's landmarks in another one, and
constexpr double kParallaxToSkipDeg = 15;     ///< maximum parallax to it, for rejection

/// Another keyframe with common landmarks.
struct Covisible {
  std::size_t node;
  int landmarks;
};

class UnorderedPlan {
 public:
  UnorderedPlan(std::vector<PlanKeyframe> keyframes, const DensifierOptions& options, const PreviousPlan& previous);

  std::vector<PlanEntry> entries() {
    find_sharers();
    leave_out();
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (entry(i).used()) choose_neighbours_of(i);
    }
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (entry(i).has_depth_map()) choose_windows_of(i);
    }
    return std::move(entries_);
  }

 private:
  PlanEntry& entry(std::size_t i) { return entries_[nodes_[i].entry]; }
  double distance(std::size_t i, std::size_t k) const { return (nodes_[i].center - nodes_[k].center).norm(); }

  void find_sharers();
  bool is_blurred(std::size_t i) const;
  void leave_out();
  void choose_neighbours_of(std::size_t i);
  std::vector<std::size_t> choose_near_of(std::size_t i) const;
  std::vector<std::int64_t> window_of(std::size_t i, int size, const std::vector<std::int64_t>* before);
  void choose_windows_of(std::size_t i);

  const DensifierOptions& options_;
  const PreviousPlan& previous_;
  std::vector<PlanNode> nodes_;                    ///< ascending id: results do not depend on the input order
  std::vector<Covisibility> covisibilities_;       ///< by node
  std::vector<SharpnessRecord> sharpness_;         ///< by node
  std::vector<std::vector<Covisible>> covisible_;  ///< by node, most landmarks first
  std::vector<PlanEntry> entries_;                 ///< in the input order
};

UnorderedPlan::UnorderedPlan(std::vector<PlanKeyframe> keyframes, const DensifierOptions& options,
                             const PreviousPlan& previous)
    : options_(options), previous_(previous), entries_(keyframes.size()) {
  std::vector<std::size_t> order(keyframes.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return keyframes[a].id < keyframes[b].id; });
  nodes_.reserve(order.size());
  covisibilities_.reserve(order.size());
  for (const std::size_t i : order) {
    entries_[i].id = keyframes[i].id;
    sharpness_.push_back(std::move(keyframes[i].sharpness));
    nodes_.emplace_back(std::move(keyframes[i]), i);
    covisibilities_.emplace_back(nodes_.back().keyframe);
  }
}

/// Uses an index of landmarks instead of comparing all pairs of keyframes.
void UnorderedPlan::find_sharers() {
  std::vector<std::pair<std::int64_t, std::size_t>> seen;  // landmark, node
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    for (const Landmark& landmark : nodes_[i].keyframe.landmarks) seen.emplace_back(landmark.id, i);
  }
  std::sort(seen.begin(), seen.end());
  seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
  std::unordered_map<std::int64_t, std::size_t> begin_of;
  for (std::size_t k = seen.size(); k > 0; --k) begin_of[seen[k - 1].first] = k - 1;
  covisible_.resize(nodes_.size());
  std::vector<int> counts(nodes_.size(), 0);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    std::vector<Covisible>& sharers = covisible_[i];
    for (const Landmark& landmark : nodes_[i].keyframe.landmarks) {
      for (std::size_t k = begin_of[landmark.id]; k < seen.size() && seen[k].first == landmark.id; ++k) {
        const std::size_t other = seen[k].second;
        if (other != i && counts[other]++ == 0) sharers.push_back({other, 0});
      }
    }
    for (Covisible& sharer : sharers) sharer.landmarks = std::exchange(counts[sharer.node], 0);
    const auto last = sharers.begin() + static_cast<std::ptrdiff_t>(std::min(kMostSharers, sharers.size()));
    std::partial_sort(sharers.begin(), last, sharers.end(), [&](const Covisible& a, const Covisible& b) {
      return a.landmarks != b.landmarks ? a.landmarks > b.landmarks : a.node < b.node;
    });
    sharers.erase(last, sharers.end());
  }
}

/// Whether its median sharpness relative to the keyframes with most common landmarks is too low, and one of them has
/// nearly the same view.
bool UnorderedPlan::is_blurred(std::size_t i) const {
  const std::vector<Covisible>& sharers = covisible_[i];
  const Keyframe& keyframe = nodes_[i].keyframe;
  if (sharers.empty() || sharpness_[i].landmarks.empty()) return false;
  const ViewChain::Preference preference = previous_.preference(keyframe.id);
  const double landmarks = static_cast<double>(keyframe.landmarks.size());
  if (sharers.front().landmarks < biased_threshold(kSharedToSkipBlurred, preference, false) * landmarks) return false;
  const PlanNode& best = nodes_[sharers.front().node];
  const CommonParallax common =
      common_parallax(keyframe.landmarks, nodes_[i].center, best.keyframe.landmarks, best.center, 0.0, 180.0);
  if (common.median_deg > biased_threshold(kParallaxToSkipDeg, preference, true)) return false;
  std::vector<double> relative;
  for (std::size_t k = 0; k < std::min(kSharpnessOf, sharers.size()); ++k) {
    relative.push_back(relative_sharpness(sharpness_[i].landmarks, sharpness_[sharers[k].node].landmarks));
  }
  return median(relative) < biased_threshold(options_.advanced.view_filter.min_sharpness, preference, true);
}

void UnorderedPlan::leave_out() {
  const bool enabled = options_.advanced.view_filter.enabled;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    KeyframeUse use = KeyframeUse::kDepthMap;
    if (enabled && is_blurred(i)) use = KeyframeUse::kBlurred;
    if (nodes_[i].keyframe.landmarks.empty()) use = KeyframeUse::kNoLandmarks;
    entry(i).use = use;
  }
  for (std::vector<Covisible>& sharers : covisible_) {
    sharers.erase(
        std::remove_if(sharers.begin(), sharers.end(), [&](const Covisible& s) { return !entry(s.node).used(); }),
        sharers.end());
  }
}

/// Returns source views with most of the keyframe's view at useful parallax; if too few, also the most useful others
/// with much of it. Views of other rooms would degrade matching.
std::vector<std::size_t> UnorderedPlan::choose_near_of(std::size_t i) const {
  const PlanNode& reference = nodes_[i];
  const int count = options_.advanced.patchmatch.neighbours;
  std::vector<std::size_t> candidates;
  std::vector<const Covisibility*> covisibilities;
  IndexById places;
  for (const Covisible& sharer : covisible_[i]) {
    if (!(distance(i, sharer.node) > 0.0)) continue;
    places.emplace(nodes_[sharer.node].keyframe.id, candidates.size());
    candidates.push_back(sharer.node);
    covisibilities.push_back(&covisibilities_[sharer.node]);
  }
  std::vector<std::size_t> chosen = choose_covisible(covisibilities_[i], covisibilities, count);
  std::vector<std::pair<double, std::size_t>> others;  // -usefulness, index
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    if (std::find(chosen.begin(), chosen.end(), k) != chosen.end()) continue;
    const double useful = neighbour_usefulness(reference.keyframe, nodes_[candidates[k]].keyframe);
    if (useful > 0.0) others.emplace_back(-useful, k);
  }
  std::sort(others.begin(), others.end());
  const auto value = [&](const std::vector<std::size_t>& list) {
    std::vector<const Covisibility*> views;
    for (const std::size_t k : list) views.push_back(covisibilities[k]);
    return covisible_usefulness(covisibilities_[i], views);
  };
  const double enough = kMinShareOfOthers * value(chosen);
  for (std::size_t k = 0; k < others.size() && chosen.size() < static_cast<std::size_t>(count); ++k) {
    if (chosen.size() < kFewestNear || value({others[k].second}) >= enough) chosen.push_back(others[k].second);
  }
  if (const PlanEntry* before = previous_.find(reference.keyframe.id)) {
    const std::vector<std::size_t> kept = indices_of(before->near, places);
    const bool as_many = !kept.empty() && kept.size() + 1 >= chosen.size();
    if (as_many && value(kept) >= kNearlyAsGood * value(chosen)) chosen = kept;
  }
  for (std::size_t& k : chosen) k = candidates[k];
  return chosen;
}

void UnorderedPlan::choose_neighbours_of(std::size_t i) {
  PlanNode& reference = nodes_[i];
  PlanEntry& decided = entry(i);
  const PlanEntry* before = previous_.find(decided.id);
  for (const std::size_t k : choose_near_of(i)) decided.near.push_back(nodes_[k].keyframe.id);
  set_use_and_range(decided, choose_range(reference.keyframe, options_.advanced.init, before));
  reference.has_depth_map = decided.has_depth_map();
}

/// Returns the keyframes with most common landmarks, or the previous window if it has nearly as many.
std::vector<std::int64_t> UnorderedPlan::window_of(std::size_t i, int size, const std::vector<std::int64_t>* before) {
  std::vector<std::int64_t> result;
  std::unordered_map<std::int64_t, int> shared;
  int most = 0;
  for (const Covisible& sharer : covisible_[i]) {
    const PlanNode& other = nodes_[sharer.node];
    if (!other.has_depth_map) continue;
    shared.emplace(other.keyframe.id, sharer.landmarks);
    if (result.size() + 1 >= static_cast<std::size_t>(size)) continue;
    result.push_back(other.keyframe.id);
    most += sharer.landmarks;
  }
  if (before == nullptr || before->size() != result.size()) return result;
  int kept = 0;
  for (const std::int64_t id : *before) {
    const auto found = shared.find(id);
    if (found == shared.end()) return result;
    kept += found->second;
  }
  return kept >= kNearlyAsGood * most ? *before : result;
}

void UnorderedPlan::choose_windows_of(std::size_t i) {
  PlanEntry& decided = entry(i);
  const PlanEntry* before = previous_.find(decided.id);
  if (options_.advanced.consistency.enabled) {
    decided.consistency =
        window_of(i, options_.advanced.consistency.window, before != nullptr ? &before->consistency : nullptr);
  }
  decided.fusion = window_of(i, options_.advanced.fusion.window, before != nullptr ? &before->fusion : nullptr);
  decided.viewers = decided.duplicate_views = decided.fusion;
  if (!options_.advanced.free_space.enabled) return;
  const auto in_window = [&](std::int64_t id) {
    return std::find(decided.fusion.begin(), decided.fusion.end(), id) != decided.fusion.end();
  };
  std::vector<std::pair<double, std::size_t>> others;  // by distance, for a selection of near and far ones
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    if (k == i || !nodes_[k].has_depth_map) continue;
    const double away = distance(i, k);
    if (away <= kReachMargin * nodes_[i].reach || in_window(nodes_[k].keyframe.id)) others.emplace_back(away, k);
  }
  std::sort(others.begin(), others.end());
  std::vector<ViewerCandidate> candidates;
  for (const auto& [away, k] : others) candidates.push_back({nodes_[k].keyframe.id, away});
  decided.viewers = choose_viewers(nodes_[i], decided.fusion, candidates, options_.advanced.free_space.views,
                                   before != nullptr ? &before->viewers : nullptr);
  if (searches_whole_mission(options_)) decided.duplicate_views = decided.viewers;
}

}  // namespace

std::vector<PlanEntry> plan_unordered(std::vector<PlanKeyframe> keyframes, const DensifierOptions& options,
                                      const PreviousPlan& previous) {
  return UnorderedPlan(std::move(keyframes), options, previous).entries();
}

}  // namespace pmsp
