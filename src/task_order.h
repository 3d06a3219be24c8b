// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "schedule.h"

namespace pmsp {

/// A stage's work on one keyframe.
struct Task {
  std::size_t stage;
  std::int64_t keyframe;
};

/// Order of the tasks of a sequence, and the time at which each artefact is released. Indices count the keyframes from
/// the start of the sequence. The Pipeline runs the tasks; MemorySimulation only simulates the memory they hold.
class TaskOrder {
 public:
  TaskOrder(const DensifierOptions& options, bool points) : unordered_(options.unordered), schedule_(options, points) {
    clear();
  }

  /// Whether several devices share the sequence; default: one does.
  void set_multi_device(bool multi_device) { multi_device_ = multi_device; }

  const Schedule& schedule() const { return schedule_; }

  void clear() {
    next_.assign(schedule_.stages().size(), 0);
    done_beyond_next_.assign(next_.size(), {});
    kept_.assign(schedule_.lifetimes().size(), 0);
    end_ = 0;
  }

  void add_keyframe() { ++end_; }
  std::int64_t end() const { return end_; }

  /// First keyframe that the stage has not run on.
  std::int64_t next(std::size_t stage) const { return next_[stage]; }
  bool is_done(const Task& task) const {
    return task.keyframe < next_[task.stage] || done_beyond_next_[task.stage].count(task.keyframe) != 0;
  }
  /// First keyframe that still has the artefact of a lifetime.
  std::int64_t first_with(std::size_t lifetime) const { return kept_[lifetime]; }
  /// First keyframe with an artefact or a stage to come.
  std::int64_t first_in_use() const { return std::min(next_.back(), *std::min_element(kept_.begin(), kept_.end())); }

  /// Returns whether all required stages have completed every keyframe up to the last one that the task may read. This
  /// keeps stages within one pass or round of each other, and inputs alive. With several devices one more keyframe must
  /// be complete, so that a device rarely waits. `last`: no keyframe follows.
  bool is_ready(const Task& task, bool last) const {
    for (const Stage::Prerequisite& need : schedule_.stages()[task.stage].needs) {
      std::int64_t until = unordered_ ? end_ : task.keyframe + need.ahead + 1 + (multi_device_ ? 1 : 0);
      if (last) until = std::min(until, end_);
      if (next_[need.stage] < until) return false;
    }
    return true;
  }

  /// The ready task of the last stage that has one, so that keyframes wait for others no longer than necessary.
  /// `may_run(task)`: whether nothing else prevents it.
  template <class MayRun>
  std::optional<Task> first_ready(bool last, const MayRun& may_run) const {
    for (std::size_t stage = next_.size(); stage-- > 0;) {
      const Task task{stage, next_[stage]};
      if (task.keyframe < end_ && is_ready(task, last) && may_run(task)) return task;
    }
    return std::nullopt;
  }
  /// All ready tasks.
  template <class MayRun>
  std::vector<Task> all_ready(bool last, const MayRun& may_run) const {
    std::vector<Task> tasks;
    for (std::size_t stage = 0; stage < next_.size(); ++stage) {
      for (Task task{stage, next_[stage]}; task.keyframe < end_; ++task.keyframe) {
        if (!is_done(task) && is_ready(task, last) && may_run(task)) tasks.push_back(task);
      }
    }
    return tasks;
  }

  /// Calls run(task), which marks it, for each task that may run now, in order. Returns early once it is false.
  template <class MayRun, class Run>
  void advance(bool last, const MayRun& may_run, const Run& run) {
    if (!multi_device_) {
      while (const std::optional<Task> task = first_ready(last, may_run)) {
        if (!run(*task)) return;
      }
      return;
    }
    // One task per stage, none depending on another.
    std::vector<Task> tasks;
    do {
      tasks.clear();
      for (std::size_t stage = next_.size(); stage-- > 0;) {
        const Task task{stage, next_[stage]};
        if (task.keyframe < end_ && is_ready(task, last) && may_run(task)) tasks.push_back(task);
      }
      for (const Task& task : tasks) {
        if (!run(task)) return;
      }
    } while (last && !tasks.empty());
  }

  /// Marks a task as done, in any order.
  void mark(const Task& task) {
    std::set<std::int64_t>& beyond = done_beyond_next_[task.stage];
    beyond.insert(task.keyframe);
    for (; !beyond.empty() && *beyond.begin() == next_[task.stage]; ++next_[task.stage]) beyond.erase(beyond.begin());
  }

  /// Calls release(artefact, keyframe) for each artefact that no task will read again.
  template <class Release>
  void release(bool last, const Release& release) {
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      const Lifetime& lifetime = schedule_.lifetimes()[k];
      std::int64_t until = end_;
      for (const Lifetime::Reader& reader : lifetime.readers) {
        const std::int64_t at = next_[reader.stage];
        if (last && at == end_) continue;  // it has run on all keyframes
        until = std::min(until, unordered_ ? 0 : at - reader.behind);
      }
      for (; kept_[k] < until; ++kept_[k]) release(lifetime.artefact, kept_[k]);
    }
  }

 private:
  bool unordered_;
  bool multi_device_ = false;
  Schedule schedule_;
  std::vector<std::int64_t> next_;                        ///< by stage
  std::vector<std::set<std::int64_t>> done_beyond_next_;  ///< by stage, keyframes after `next_` that it has run on
  std::vector<std::int64_t> kept_;                        ///< by lifetime, the first keyframe that has the artefact
  std::int64_t end_ = 0;                                  ///< keyframes that have come
};

}  // namespace pmsp
