// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "engine.h"
#include "patchmatch/neighbours.h"
#include "patchmatch/revisits.h"
#include "pmsp/densifier.h"
#include "pmsp/free_space.h"
#include "pmsp/revisit_filter.h"
#include "pmsp/view_filter.h"

namespace pmsp {

/// An accepted keyframe on its way through the stages.
struct View {
  Keyframe keyframe;  ///< its image and mask are gone; what is left of them is in the frame
  std::unique_ptr<Engine::Frame> frame;
  Outlook outlook;
  std::vector<std::int64_t> neighbours;  ///< what all passes of matching look at, and between which depths
  std::size_t near = 0;                  ///< the first so many of them are near in the sequence
  DepthRange range;
};

/// Stages run as soon as the keyframes that they look at are there: matching waits for `match_ahead` keyframes after
/// its own, each further pass for the maps of as many, the consistency filter for the maps of `filter_ahead`, fusion
/// for `fuse_ahead`. Indices count from the start of the sequence.
struct Densifier::Impl {
  Impl(const DensifierOptions& given, DensifierCallbacks to);

  View& view(std::int64_t i) { return views[static_cast<std::size_t>(i - first)]; }
  std::int64_t end() const { return first + static_cast<std::int64_t>(views.size()); }
  bool stopped() const { return cancel.load(std::memory_order_relaxed); }

  std::int64_t match_ahead() const { return neighbour_reach(options.patchmatch.neighbours); }
  std::int64_t filter_ahead() const { return options.consistency.enabled ? (options.consistency.window - 1) / 2 : 0; }
  std::int64_t fuse_ahead() const { return (options.fusion.window - 1) / 2; }

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

  void prepare(const Keyframe& keyframe);
  void advance(bool last);
  void choose(std::int64_t i);
  void add_revisits(std::int64_t i);
  bool starts_from_previous(std::int64_t i);
  void match(std::int64_t i, int pass);
  void filter(std::int64_t i);
  void fuse(std::int64_t i);
  bool keeps_sights() const;
  void take(const DepthMap& map);
  void hold(KeyframeCloud cloud);
  void hand_out();
  void forget();

  DensifierOptions options;
  DensifierCallbacks callbacks;  ///< of the caller
  EngineResults results;         ///< what the engine calls
  ViewFilter view_filter;
  RevisitFilter revisits;
  DensifierStats stats;
  std::atomic<bool> cancel{false};
  std::set<std::int64_t> ids;
  Backend requested = Backend::kAuto;
  std::string backend;             ///< the one in force, and why
  std::unique_ptr<Engine> engine;  ///< before the views, whose frames must not outlive it
  std::deque<View> views;
  std::deque<KeyframeCloud> held;        ///< fused, not yet handed out
  std::deque<SightMap> sights;           ///< of the last keyframes
  std::int64_t first = 0;                ///< index of views.front()
  std::int64_t first_active = 0;         ///< keyframes before are only remembered as what others are matched with
  std::vector<std::int64_t> next_match;  ///< for each pass
  std::int64_t next_filter = 0;
  std::int64_t next_fuse = 0;
};

}  // namespace pmsp
