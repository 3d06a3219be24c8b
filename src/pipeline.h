// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "engine.h"
#include "plan/halo.h"
#include "plan/plan_part.h"
#include "plan/planner.h"
#include "planned_densifier.h"
#include "schedule.h"
#include "stage_progress.h"

namespace pmsp {

/// A used keyframe on its way through the stages.
struct View {
  Keyframe keyframe;  ///< its image and mask are gone; what is left of them is in the frame
  std::unique_ptr<Engine::Frame> frame;
  std::size_t place;  ///< of its entry in the plan; in one that is made meanwhile, among all keyframes that were added
};

/// A stage's work on one keyframe.
struct Task {
  std::size_t stage;
  std::int64_t keyframe;
};

/// What a Densifier does: runs a plan, the one that the planner makes meanwhile or part of a given one. A task may run
/// as soon as the plan says what it looks at and the stages that it needs have been there; the order of those that may
/// run changes no byte of what they leave. Indices count the keyframes that take part from the start of the sequence.
class Pipeline {
 public:
  /// `given`: valid. `part`: nullopt = the plan is made of the keyframes that come, and all of it is run.
  /// `load`: gives the planes of an earlier run that the part names.
  Pipeline(const DensifierOptions& given, std::optional<PlanPart> part, PlannedCallbacks to,
           std::function<PlaneMap(std::int64_t id)> load = nullptr);

  /// As those of the Densifier.
  bool add(const Keyframe& keyframe);
  void flush();
  void run(const KeyframeSource& keyframes);
  void stop() noexcept { cancel_.store(true, std::memory_order_relaxed); }
  bool stopped() const noexcept { return cancel_.load(std::memory_order_relaxed); }
  const DensifierStats& stats() const { return stats_; }
  std::vector<std::int64_t> images() const;
  const DensifierOptions& options() const { return options_; }
  const std::string& backend() const { return backend_; }

  /// For tests: chooses the next one of the tasks that may run, or nullopt to leave them for later. Not set: the first
  /// one of the last stage that has any.
  std::function<std::optional<Task>(const std::vector<Task>&)> choose;

 private:
  /// Work that fails half-way leaves frames that later work must not look at.
  template <class Work>
  auto or_stop(const Work& work) {
    try {
      return work();
    } catch (...) {
      stop();
      throw;
    }
  }

  View& view(std::int64_t i) { return views_[static_cast<std::size_t>(i - first_)]; }
  std::int64_t end() const { return first_ + static_cast<std::int64_t>(views_.size()); }
  const PlanEntry& entry_of(const View& view) const {
    return part_ ? part_->entry(view.place) : planner_.entries()[view.place - dropped_];
  }
  bool runs(const Stage& stage, const View& view) const { return !part_ || part_->runs(stage, view.place); }
  Engine::Frame* frame_of(std::int64_t id) { return view(index_of_.at(id)).frame.get(); }
  std::vector<const Engine::Frame*> matched_frames(const std::vector<std::int64_t>& keyframes);

  bool takes_part(std::int64_t id) const;
  bool take(const Keyframe& keyframe);
  KeyframeUse decide_use(const Keyframe& keyframe);
  void check_all_there() const;
  void finish();
  void prepare(const Keyframe& keyframe, std::size_t place);
  bool goes_in_step() const { return options_.backend == Backend::kCuda && options_.devices.size() > 1; }
  void advance(bool last);
  void advance_in_step(bool last);
  std::optional<Task> next_task(bool last);
  std::vector<Task> ready_tasks(bool last);
  bool is_ready(const Task& task, bool last);
  bool is_planned(const Task& task);
  std::size_t planned_for(Stage::Kind kind) const;

  void run_task(const Task& task, bool last);
  void run(const Stage& stage, std::int64_t i);
  PassRange passes_of(const View& view) const;
  void take_earlier(const View& reference, int pass);
  void match(const View& reference, int pass);
  void fuse(const View& reference);
  void forget(bool last);
  void drop_entries(std::size_t count);
  void count_without_depth_map(KeyframeUse use);

  const DensifierOptions given_options_;  ///< what the plan is made with; sizes may be 0
  DensifierOptions options_;
  PlannedCallbacks callbacks_;  ///< of the caller
  EngineResults results_;       ///< what the engine calls
  const Schedule schedule_;
  Planner planner_;
  const std::optional<PlanPart> part_;  ///< in place of what the planner makes
  const std::function<PlaneMap(std::int64_t id)> load_planes_;
  DensifierStats stats_;
  std::atomic<bool> cancel_{false};
  KeyframeSource image_again_;  ///< set during `run`
  std::set<std::int64_t> ids_;
  std::string backend_;             ///< the one in force, and why
  std::unique_ptr<Engine> engine_;  ///< before the views, whose frames must not outlive it
  std::deque<View> views_;
  std::unordered_map<std::int64_t, std::int64_t> index_of_;  ///< of a view, by the keyframe's id
  std::size_t places_ = 0;                                   ///< keyframes that the planner was given
  std::size_t dropped_ = 0;                                  ///< entries of its plan that are done with
  std::size_t taken_ = 0;                                    ///< keyframes that have come and take part
  std::int64_t first_ = 0;                                   ///< index of views_.front()
  Progress progress_;
  std::vector<std::int64_t> kept_;  ///< for each lifetime, the first one that has the artefact
};

}  // namespace pmsp
