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
#include "schedule.h"

namespace pmsp {

/// A used keyframe on its way through the stages.
struct View {
  Keyframe keyframe;  ///< its image and mask are gone; what is left of them is in the frame
  std::unique_ptr<Engine::Frame> frame;
  std::size_t place;  ///< of its entry in the plan, counted from the first keyframe that was added
};

/// Runs the plan that the planner makes meanwhile, in the order of the schedule. A stage works on one keyframe after
/// the other, as soon as the plan says what it looks at and the stages that it needs have been there. Indices count the
/// used keyframes from the start of the sequence.
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
  const PlanEntry& entry_of(const View& view) const { return planner.entries()[view.place - dropped]; }
  Engine::Frame* frame_of(std::int64_t id) { return view(index_of.at(id)).frame.get(); }
  std::vector<const Engine::Frame*> matched_frames(const std::vector<std::int64_t>& ids);

  static std::vector<const Engine::Frame*> nearest_first(const Engine::Frame& reference,
                                                         std::vector<const Engine::Frame*> frames);

  void prepare(const Keyframe& keyframe);
  void advance(bool last);
  bool may_run(std::size_t stage, bool last);
  std::size_t planned_for(Stage::Kind kind) const;
  void run(const Stage& stage, std::int64_t i);
  void match(const View& reference, int pass);
  void fuse(const View& reference);
  void forget(bool last);

  const DensifierOptions given_options;  ///< what the plan is made with; sizes may be 0
  DensifierOptions options;
  DensifierCallbacks callbacks;  ///< of the caller
  EngineResults results;         ///< what the engine calls
  const Schedule schedule;
  Planner planner;
  DensifierStats stats;
  std::atomic<bool> cancel{false};
  std::set<std::int64_t> ids;
  std::string backend;             ///< the one in force, and why
  std::unique_ptr<Engine> engine;  ///< before the views, whose frames must not outlive it
  std::deque<View> views;
  std::unordered_map<std::int64_t, std::int64_t> index_of;  ///< of a view, by the keyframe's id
  std::size_t places = 0;                                   ///< keyframes added
  std::size_t dropped = 0;                                  ///< entries of the plan that are done with
  std::int64_t first = 0;                                   ///< index of views.front()
  std::vector<std::int64_t> next;                           ///< keyframe for each stage
  std::vector<std::int64_t> kept;                           ///< for each lifetime, the first one that has the artefact
};

}  // namespace pmsp
