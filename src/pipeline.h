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
#include "task_order.h"

namespace pmsp {

/// Used keyframe with its frame.
struct UsedKeyframe {
  Keyframe keyframe;  ///< without image, mask and prior depth
  std::unique_ptr<Engine::Frame> frame;
  std::size_t entry_index;  ///< index of its plan entry; without a given plan, among all added keyframes
};

/// Implementation of the Densifier: runs the plan of its planner, made incrementally, or part of a given plan. A task
/// is ready if the plan of its keyframe is decided and the required stages have completed; the order of ready tasks
/// does not affect results. Indices count participating keyframes from the start of the sequence.
class Pipeline {
 public:
  /// `given`: validated options. `part`: nullopt = the plan is made from the added keyframes and runs completely.
  /// `load`: returns the planes of an earlier run that the part requires.
  Pipeline(const DensifierOptions& given, std::optional<PlanPart> part, PlannedCallbacks to,
           std::function<PlaneMap(std::int64_t id)> load = nullptr);

  /// See Densifier.
  bool add(const Keyframe& keyframe);
  void flush();
  void run(const KeyframeSource& keyframes);
  void stop() noexcept { cancel_.store(true, std::memory_order_relaxed); }
  bool stopped() const noexcept { return cancel_.load(std::memory_order_relaxed); }
  const DensifierStats& stats() const { return stats_; }
  std::vector<std::int64_t> images() const;
  const DensifierOptions& options() const { return options_; }
  const std::string& backend() const { return backend_; }

  /// For tests: selects one of the ready tasks, nullopt = none yet. Unset: the first task of the last stage with any.
  std::function<std::optional<Task>(const std::vector<Task>&)> choose;

 private:
  /// Stops after exceptions, which may leave incomplete frames.
  template <class Work>
  auto stop_on_exception(const Work& work) {
    try {
      return work();
    } catch (...) {
      stop();
      throw;
    }
  }

  UsedKeyframe& used(std::int64_t i) { return used_[static_cast<std::size_t>(i - first_)]; }
  const PlanEntry& entry_of(const UsedKeyframe& view) const {
    return part_ ? part_->entry(view.entry_index) : planner_.entries()[view.entry_index - dropped_];
  }
  bool runs(const Stage& stage, const UsedKeyframe& view) const {
    return !part_ || part_->runs(stage, view.entry_index);
  }
  Engine::Frame* frame_of(std::int64_t id) { return used(index_of_.at(id)).frame.get(); }
  std::vector<const Engine::Frame*> matched_frames(const std::vector<std::int64_t>& keyframes);

  void make_engine();
  bool takes_part(std::int64_t id) const;
  bool take(const Keyframe& keyframe);
  KeyframeUse decide_use(const Keyframe& keyframe);
  void check_complete() const;
  void finish();
  void prepare(const Keyframe& keyframe, std::size_t entry_index);
  void advance(bool last);
  bool may_run(const Task& task, bool last);
  bool is_planned(const Task& task);
  std::size_t planned_for(Stage::Kind kind) const;

  void run_task(const Task& task, bool last);
  void run(const Stage& stage, std::int64_t i);
  PassRange passes_of(const UsedKeyframe& view) const;
  void load_earlier_planes(const UsedKeyframe& reference, int pass);
  void match(const UsedKeyframe& reference, int pass);
  void fuse(const UsedKeyframe& reference);
  void release(bool last);
  void drop_entries(std::size_t count);
  void count_without_depth_map(KeyframeUse use);

  const DensifierOptions given_options_;  ///< options of the plan; sizes may be 0
  DensifierOptions options_;
  PlannedCallbacks callbacks_;  ///< of the caller
  EngineResults results_;       ///< called by the engine
  Planner planner_;
  const std::optional<PlanPart> part_;  ///< instead of the planner's plan
  const std::function<PlaneMap(std::int64_t id)> load_planes_;
  DensifierStats stats_;
  std::atomic<bool> cancel_{false};
  KeyframeSource reload_image_;  ///< set during `run`
  std::set<std::int64_t> ids_;
  std::string backend_;             ///< backend in use, with the reason
  std::unique_ptr<Engine> engine_;  ///< declared before the views, whose frames must not outlive it
  std::deque<UsedKeyframe> used_;
  std::unordered_map<std::int64_t, std::int64_t> index_of_;  ///< by keyframe id
  std::size_t planner_keyframes_ = 0;                        ///< keyframes passed to the planner
  std::size_t dropped_ = 0;                                  ///< released entries of the planner's plan
  std::size_t taken_ = 0;                                    ///< participating keyframes so far
  std::int64_t first_ = 0;                                   ///< index of used_.front()
  TaskOrder order_;
};

}  // namespace pmsp
