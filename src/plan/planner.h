// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "plan/choices.h"
#include "plan/plan.h"
#include "plan/reach.h"
#include "pmsp/api.h"
#include "view_filter/view_chain.h"

namespace pmsp {

/// Incremental make_plan: each entry is decided as soon as the keyframes that it depends on are known. Memory is
/// bounded for sequences; an unordered set is decided by `finish`.
class PMSP_API Planner {
 public:
  /// Throws InvalidOption.
  explicit Planner(const DensifierOptions& options, const Plan* previous = nullptr);

  /// Returns whether the keyframe is used; in an unordered set, whether it can be.
  bool add(PlanKeyframe keyframe);

  /// Completes all entries. Later keyframes start a new sequence.
  void finish();

  /// Entries in the order of `add`, without dropped ones.
  const std::deque<PlanEntry>& entries() const { return entries_; }
  /// Number of entries with decided `use`, `near`, `first_planes` and `range`.
  std::size_t matchable() const { return entries_before(next_match_); }
  /// Number of entries that also have `consistency` and `fusion`.
  std::size_t windowed() const { return entries_before(next_window_); }
  /// Number of complete entries: also with `viewers` and `duplicate_views`.
  std::size_t complete() const { return entries_before(next_viewers_); }
  /// Drops the first `count` entries, which must be complete.
  void drop(std::size_t count);

 private:
  KeyframeUse decide_use(const PlanKeyframe& keyframe);
  KeyframeUse begin_block(const PlanKeyframe& keyframe);
  bool is_blurred(const PlanKeyframe& keyframe) const;
  void take_into_chain(const PlanKeyframe& keyframe);

  void advance(bool last);
  void choose_neighbours_of(std::int64_t i);
  void choose_windows_of(std::int64_t i);
  void choose_viewers_of(std::int64_t i);
  std::vector<std::int64_t> window_around(std::int64_t i, std::int64_t half) const;
  void forget();

  PlanNode& node(std::int64_t i) { return nodes_[static_cast<std::size_t>(i - first_)]; }
  const PlanNode& node(std::int64_t i) const { return nodes_[static_cast<std::size_t>(i - first_)]; }
  PlanEntry& entry_of(const PlanNode& node) { return entries_[node.entry - dropped_]; }
  std::int64_t end() const { return first_ + static_cast<std::int64_t>(nodes_.size()); }
  std::size_t entries_before(std::int64_t next) const;

  DensifierOptions options_;
  PlanReach reach_;
  PreviousPlan previous_;
  std::deque<PlanEntry> entries_;
  std::size_t dropped_ = 0;  ///< number of dropped entries

  ViewChain chain_;             ///< of the current block
  bool in_sequence_ = false;    ///< a keyframe was added
  bool block_begun_ = false;    ///< its first keyframe with landmarks was added
  bool used_in_block_ = false;  ///< besides its first one
  std::int64_t block_ = 0;

  std::deque<PlanNode> nodes_;     ///< used keyframes; indices count from the start of the sequence
  std::int64_t first_ = 0;         ///< index of nodes_.front()
  std::int64_t next_match_ = 0;    ///< first node with undecided source views
  std::int64_t next_window_ = 0;   ///< first node with undecided windows
  std::int64_t next_viewers_ = 0;  ///< first node with undecided viewers
  std::int64_t next_clear_ = 0;    ///< first node with landmarks in memory
  std::vector<PlanKeyframe> set_;  ///< of an unordered set
};

/// Returns floor(a / b) for any sign of a; b > 0.
std::int64_t floor_div(std::int64_t a, std::int64_t b);

}  // namespace pmsp
