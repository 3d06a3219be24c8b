// SPDX-License-Identifier: BSD-2-Clause
#include "plan/planner.h"

#include <algorithm>
#include <utility>

#include "plan/reach.h"
#include "plan/unordered.h"

namespace pmsp {

std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

Planner::Planner(const DensifierOptions& options, const Plan* previous)
    : options_(options), reach_(plan_reach(options)), previous_(previous), chain_(options.advanced.view_filter) {
  options.validate();
}

std::size_t Planner::entries_before(std::int64_t next) const {
  if (options_.unordered) return set_.empty() ? entries_.size() : 0;
  return next < end() ? node(next).entry - dropped_ : entries_.size();
}

void Planner::drop(std::size_t count) {
  entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(count));
  dropped_ += count;
}

bool Planner::add(PlanKeyframe keyframe) {
  if (options_.unordered) {
    set_.push_back(std::move(keyframe));
    return !set_.back().landmarks.empty();
  }
  // Sorted once for several comparisons.
  std::stable_sort(keyframe.landmarks.begin(), keyframe.landmarks.end(),
                   [](const Landmark& a, const Landmark& b) { return a.id < b.id; });
  PlanEntry entry;
  entry.id = keyframe.id;
  entry.use = decide_use(keyframe);
  const std::size_t index = dropped_ + entries_.size();
  const bool used = entry.used();
  entries_.push_back(std::move(entry));
  if (!used) return false;
  nodes_.emplace_back(std::move(keyframe), index);
  advance(false);
  return true;
}

void Planner::finish() {
  if (options_.unordered) {
    for (PlanEntry& entry : plan_unordered(std::move(set_), options_, previous_)) entries_.push_back(std::move(entry));
    set_.clear();
    return;
  }
  advance(true);
  nodes_.clear();
  first_ = next_match_ = next_window_ = next_viewers_ = next_clear_ = 0;
  chain_.clear();
  in_sequence_ = block_begun_ = used_in_block_ = false;
}

/// Returns the use of the keyframe, or the reason for its rejection.
KeyframeUse Planner::decide_use(const PlanKeyframe& keyframe) {
  if (!options_.advanced.view_filter.enabled) return KeyframeUse::kDepthMap;
  const bool first = !in_sequence_;
  const std::int64_t block = floor_div(keyframe.id, kViewBlock);
  if (first || block != block_) block_begun_ = false;
  in_sequence_ = true;
  block_ = block;
  if (!block_begun_) {
    if (keyframe.landmarks.empty()) return first ? KeyframeUse::kDepthMap : KeyframeUse::kNoLandmarks;
    return begin_block(keyframe);
  }
  const ViewChain::Preference preference = previous_.preference(keyframe.id);
  const ViewChain::Verdict verdict = chain_.compare(keyframe.landmarks, keyframe.cam_from_world.center(), preference);
  if (verdict.use != KeyframeUse::kDepthMap) return verdict.use;
  if (verdict.redundant && is_blurred(keyframe)) return KeyframeUse::kBlurred;
  take_into_chain(keyframe);
  used_in_block_ = true;
  return KeyframeUse::kDepthMap;
}

/// Starts the chain again at this keyframe, used or not.
KeyframeUse Planner::begin_block(const PlanKeyframe& keyframe) {
  KeyframeUse use = KeyframeUse::kDepthMap;
  if (used_in_block_) {  // in the previous block
    const ViewChain::Preference preference = previous_.preference(keyframe.id);
    const ViewChain::Verdict verdict = chain_.compare(keyframe.landmarks, keyframe.cam_from_world.center(), preference);
    if (verdict.use == KeyframeUse::kTooLittleParallax) use = verdict.use;
    if (verdict.redundant && is_blurred(keyframe)) use = KeyframeUse::kBlurred;
  }
  chain_.clear();
  take_into_chain(keyframe);
  block_begun_ = true;
  used_in_block_ = false;
  return use;
}

bool Planner::is_blurred(const PlanKeyframe& keyframe) const {
  return options_.advanced.view_filter.min_sharpness > 0.0 &&
         chain_.is_blurred(keyframe.sharpness.landmarks, previous_.preference(keyframe.id));
}

void Planner::take_into_chain(const PlanKeyframe& keyframe) {
  chain_.add(keyframe.landmarks, keyframe.cam_from_world.center());
  if (!keyframe.sharpness.landmarks.empty()) chain_.add_sharpness(keyframe.sharpness.landmarks);
}

void Planner::advance(bool last) {
  while (last ? next_match_ < end() : next_match_ + reach_.near < end()) choose_neighbours_of(next_match_++);
  while (last ? next_window_ < end() : next_window_ + reach_.windows < next_match_) choose_windows_of(next_window_++);
  const std::int64_t viewers = std::max(reach_.windows, reach_.viewers_after);
  while (last ? next_viewers_ < end() : next_viewers_ + viewers < next_match_) choose_viewers_of(next_viewers_++);
  forget();
}

void Planner::choose_neighbours_of(std::int64_t i) {
  PlanNode& reference = node(i);
  PlanEntry& entry = entry_of(reference);
  const PlanEntry* before = previous_.find(entry.id);
  const std::int64_t from = std::max(first_, i - reach_.near);
  const std::int64_t to = std::min(end(), i + reach_.near + 1);
  std::vector<const Keyframe*> sequence;
  for (std::int64_t k = from; k < to; ++k) sequence.push_back(&node(k).keyframe);
  const std::vector<std::size_t> near =
      choose_near(sequence, static_cast<std::size_t>(i - from), options_.advanced.patchmatch.neighbours, before);
  for (const std::size_t k : near) entry.near.push_back(sequence[k]->id);
  set_use_and_range(entry, choose_range(reference.keyframe, options_.advanced.init, before));
  reference.has_depth_map = entry.has_depth_map();
  const std::int64_t chain = options_.advanced.init.chain_keyframes;
  if (options_.advanced.init.warp_previous && entry.has_depth_map() && i > first_ && node(i - 1).has_depth_map) {
    const std::int64_t id = node(i - 1).keyframe.id;
    if (chain == 0 || floor_div(id, chain) == floor_div(entry.id, chain)) entry.first_planes = id;
  }
}

std::vector<std::int64_t> Planner::window_around(std::int64_t i, std::int64_t half) const {
  std::vector<std::int64_t> result;
  for (std::int64_t k = std::max(first_, i - half); k <= std::min(end() - 1, i + half); ++k) {
    if (k != i && node(k).has_depth_map) result.push_back(node(k).keyframe.id);
  }
  return result;
}

void Planner::choose_windows_of(std::int64_t i) {
  const PlanNode& reference = node(i);
  PlanEntry& entry = entry_of(reference);
  if (!entry.has_depth_map()) return;
  if (options_.advanced.consistency.enabled) entry.consistency = window_around(i, reach_.consistency);
  entry.fusion = window_around(i, reach_.fusion);
}

void Planner::choose_viewers_of(std::int64_t i) {
  const PlanNode& reference = node(i);
  PlanEntry& entry = entry_of(reference);
  if (!entry.has_depth_map()) return;
  entry.viewers = entry.duplicate_views = entry.fusion;
  if (!options_.advanced.free_space.enabled) return;
  const PlanEntry* const before = previous_.find(entry.id);
  const auto choose = [&](std::int64_t behind, std::int64_t ahead, const std::vector<std::int64_t>* known) {
    std::vector<ViewerCandidate> candidates;
    for (std::int64_t k = std::max(first_, i - behind); k <= std::min(end() - 1, i + ahead); ++k) {
      if (k == i || !node(k).has_depth_map) continue;
      candidates.push_back({node(k).keyframe.id, (node(k).center - reference.center).norm()});
    }
    return choose_viewers(reference, entry.fusion, candidates, options_.advanced.free_space.views, known);
  };
  entry.viewers = choose(reach_.viewers_before, reach_.viewers_after, before != nullptr ? &before->viewers : nullptr);
  if (!searches_whole_mission(options_)) return;
  entry.duplicate_views =
      choose(reach_.duplicate_views, reach_.duplicate_views, before != nullptr ? &before->duplicate_views : nullptr);
}

/// Releases data that later keyframes do not need.
void Planner::forget() {
  for (; next_clear_ < next_match_ - reach_.near; ++next_clear_) {
    std::vector<Landmark>().swap(node(next_clear_).keyframe.landmarks);
  }
  const std::int64_t windows = std::max(reach_.viewers_before, reach_.windows);
  const std::int64_t keep = std::min({next_clear_, next_viewers_ - windows, next_match_ - reach_.near});
  for (; first_ < keep; ++first_) nodes_.pop_front();
}

}  // namespace pmsp
