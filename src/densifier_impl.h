// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "engine.h"
#include "plan/planner.h"
#include "pmsp/densifier.h"
#include "pmsp/free_space.h"
#include "pmsp/revisit_filter.h"

namespace pmsp {

/// A used keyframe on its way through the stages.
struct View {
  Keyframe keyframe;  ///< its image and mask are gone; what is left of them is in the frame
  std::unique_ptr<Engine::Frame> frame;
  std::size_t place;  ///< of its entry in the plan, counted from the first keyframe that was added
};

/// Runs the plan that the planner makes meanwhile. A stage works on one keyframe after the other, as soon as the plan
/// says what it looks at and the stage before has been there: each pass of PatchMatch for `match_ahead` keyframes more
/// than its own, the consistency filter for `filter_ahead`, fusion for `fuse_ahead`. Indices count the used keyframes
/// from the start of the sequence.
struct Densifier::Impl {
  Impl(const DensifierOptions& given, DensifierCallbacks to);

  bool add(const Keyframe& keyframe);
  void flush();

  /// Work that fails half-way leaves frames that later work must not look at.
  template <class Work>
  auto or_cancel(const Work& work) {
    try {
      return work();
    } catch (...) {
      cancel = true;
      throw;
    }
  }

  bool stopped() const { return cancel.load(std::memory_order_relaxed); }
  View& view(std::int64_t i) { return views[static_cast<std::size_t>(i - first)]; }
  std::int64_t end() const { return first + static_cast<std::int64_t>(views.size()); }
  const PlanEntry& entry_at(std::size_t place) const { return planner.entries()[place - dropped]; }
  Engine::Frame* frame_of(std::int64_t id) { return view(index_of.at(id)).frame.get(); }
  std::vector<Engine::Frame*> matched_frames(const std::vector<std::int64_t>& ids);

  std::int64_t match_ahead() const { return planner.match_delay(); }
  std::int64_t filter_ahead() const { return options.consistency.enabled ? (options.consistency.window - 1) / 2 : 0; }
  std::int64_t fuse_ahead() const { return (options.fusion.window - 1) / 2; }
  bool is_planned(std::int64_t i, std::size_t entries) { return i < end() && view(i).place - dropped < entries; }

  void prepare(const Keyframe& keyframe);
  void advance(bool last);
  void match(std::int64_t i, int pass);
  void filter(std::int64_t i);
  void fuse(std::int64_t i);
  bool keeps_sights() const;
  void take(const DepthMap& map);
  void hold(KeyframeCloud cloud);
  void hand_out(bool last);
  bool viewers_are_there(const PlanEntry& entry) const;
  void check_and_hand_out(KeyframeCloud cloud, const PlanEntry& entry);
  void forget(bool last);
  void forget_sights_before(std::int64_t id);

  const DensifierOptions given_options;  ///< what the plan is made with; sizes may be 0
  DensifierOptions options;
  DensifierCallbacks callbacks;  ///< of the caller
  EngineResults results;         ///< what the engine calls
  Planner planner;
  RevisitFilter revisits;
  DensifierStats stats;
  std::atomic<bool> cancel{false};
  std::set<std::int64_t> ids;
  std::string backend;             ///< the one in force, and why
  std::unique_ptr<Engine> engine;  ///< before the views, whose frames must not outlive it
  std::deque<View> views;
  std::unordered_map<std::int64_t, std::int64_t> index_of;  ///< of a view, by the keyframe's id
  std::unordered_map<std::int64_t, std::size_t> place_of;   ///< of an entry in the plan, by the keyframe's id
  std::unordered_map<std::int64_t, SightMap> sights;        ///< that viewers may still be asked for
  std::deque<std::int64_t> sight_ids;                       ///< in the order in which they came
  std::deque<std::int64_t> fused;        ///< keyframes whose points were asked for and not handed out yet
  std::deque<KeyframeCloud> held;        ///< fused, not yet handed out
  std::size_t dropped = 0;               ///< entries of the plan that are done with
  std::int64_t first = 0;                ///< index of views.front()
  std::int64_t first_matching = 0;       ///< planes of the passes of keyframes before are gone
  std::int64_t first_active = 0;         ///< keyframes before are only remembered as what others are matched with
  std::vector<std::int64_t> next_match;  ///< for each pass
  std::int64_t next_filter = 0;
  std::int64_t next_fuse = 0;
};

}  // namespace pmsp
