// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <iterator>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "densifier_checks.h"
#include "live/live_builder.h"
#include "live/live_image.h"
#include "live/live_map.h"
#include "live/live_tracker.h"
#include "machine.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "util/check_option.h"

namespace pmsp {
namespace {

/// Number of newest keyframes of a map, rejected ones included, whose landmarks are updated.
constexpr std::size_t kRecentKeyframes = 128;

/// Returns free heap memory to the system. Large arrays are part of the heap, too: glibc raises the size from which it
/// maps them separately to that of the largest array freed.
void trim_heap() {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}

void check_state(const LiveKeyframe& keyframe) {
  const std::string who = "keyframe " + std::to_string(keyframe.id) + ": ";
  check_pose(who, keyframe.cam_from_world);
  check_landmarks(who, keyframe.landmarks);
  check_pose_error(who, keyframe.pose_error);
}

}  // namespace

void LiveOptions::validate() const {
  densifier.validate();
  if (densifier.unordered)
    throw InvalidOption("unordered is true; expected false: a live map takes keyframes in order");
  if (!densifier.scratch_folder.empty()) {
    throw InvalidOption("scratch_folder is " + densifier.scratch_folder +
                        "; expected none: a live map keeps all in memory, see memory_mib");
  }
  check_option("nice", nice, 0, 19);
  check_option("memory_mib", memory_mib, 1, 1000000);
  check_option("max_waiting", max_waiting, 4, 100000);
  check_option("stable_after", stable_after, 0, 1000);
  check_option("stable_at_latest", stable_at_latest, stable_after, 1000);
  check_option("stable_move", stable_move, 0.0, 1.0);
  check_option("max_move_px", max_move_px, 0.001, 100.0);
}

/// Public calls validate and queue their changes. `apply_changes` applies these to tracker and map before public reads
/// and publication, and forwards them to the worker. Scales are therefore estimated on reading threads or the worker,
/// never on a calling SLAM thread.
struct LiveDensifier::Impl {
  Impl(const LiveOptions& options, LiveCallbacks callbacks) : options_(options), callbacks_(std::move(callbacks)) {
    options_.validate();
    if (options_.mask && options_.mask->empty()) options_.mask.reset();
    std::exception_ptr failed;
    bool begun = false;
    worker_ = std::thread([&] {
      std::exception_ptr why;
      try {
        run_at_low_priority(options_.nice);
        builder_ = make_builder();
      } catch (...) {
        why = std::current_exception();
      }
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        failed = why;
        begun = true;
        if (builder_) backend_ = builder_->backend();
      }
      changed_.notify_all();
      if (builder_) work();
    });
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [&] { return begun; });
    }
    if (!failed) return;
    worker_.join();
    std::rethrow_exception(failed);
  }

  ~Impl() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
      cancel_.store(true, std::memory_order_relaxed);
    }
    changed_.notify_all();
    worker_.join();
    builder_.reset();  // at the priority of this thread
    trim_heap();
  }

  // ---- callers ----

  void add(LiveKeyframe keyframe) {
    check_state(keyframe);
    post([&] {
      if (!knows(keyframe.id)) {
        check_image_of(keyframe);
        return queue_new(std::move(keyframe));
      }
      std::vector<LiveKeyframe> states;
      states.push_back(state_of(keyframe, std::move(keyframe.landmarks)));
      move(std::move(states));
    });
  }

  void update(const std::vector<LiveKeyframe>& keyframes) {
    std::vector<LiveKeyframe> states = states_of(keyframes);
    post([&] { move(std::move(states)); });
  }

  void sync(const std::vector<LiveKeyframe>& keyframes) {
    std::set<std::int64_t> there;
    for (const LiveKeyframe& keyframe : keyframes) {
      if (!there.insert(keyframe.id).second) {
        throw InvalidInput("sync: keyframe " + std::to_string(keyframe.id) + " is there twice");
      }
    }
    std::vector<LiveKeyframe> states = states_of(keyframes);
    post([&] {
      std::vector<LiveKeyframe> fresh;
      for (std::size_t i = 0; i < keyframes.size(); ++i) {
        const LiveKeyframe& keyframe = keyframes[i];
        if (knows(keyframe.id) || keyframe.image.data == nullptr) continue;
        check_image_of(keyframe);
        LiveKeyframe& added = fresh.emplace_back(std::move(states[i]));
        added.image = keyframe.image;
        added.prior_depth = keyframe.prior_depth;
        added.pose_error = keyframe.pose_error;
      }
      std::vector<std::int64_t> gone;
      std::set_difference(known_.begin(), known_.end(), there.begin(), there.end(), std::back_inserter(gone));
      erase_known(gone);
      move(std::move(states));  // ignores new ones
      std::sort(fresh.begin(), fresh.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
      for (LiveKeyframe& keyframe : fresh) queue_new(std::move(keyframe));
    });
  }

  void erase(const std::vector<std::int64_t>& ids) {
    post([&] { erase_known(ids); });
  }

  void reset() {
    // Freed outside the lock: owners of images may acquire any lock.
    std::deque<Task> dropped_tasks;
    std::deque<Change> dropped_changes;
    post([&] {
      ++stats_.resets;
      ++generation_;
      queue_.swap(dropped_tasks);
      changes_.swap(dropped_changes);
      known_.clear();
      changes_.emplace_back([this] {
        tracker_.reset();
        map_.reset();
      });
      finishing_ = false;
      queued_keyframes_ = taken_keyframes_ = 0;
      cancel_.store(true, std::memory_order_relaxed);  // work in progress is obsolete
    });
  }

  void finish() {
    post([&] {
      finishing_ = true;
      changes_.emplace_back([this] { enqueue({[](LiveBuilder& builder) { builder.finish(); }}); });
    });
  }

  void set_paused(bool paused) {
    post([&] { paused_ = paused; });
  }

  bool wait(std::chrono::milliseconds at_most) const {
    std::unique_lock<std::mutex> lock(mutex_);
    const std::chrono::milliseconds longest = std::chrono::hours(24 * 365);  // more would overflow
    return changed_.wait_for(lock, std::min(at_most, longest), [&] { return is_idle() || stats_.failed; }) && is_idle();
  }

  LiveStats stats() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return sum(stats_, worker_stats_);
  }

  LiveBacklog backlog() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    LiveBacklog backlog = backlog_;
    backlog.unstable += queued_keyframes_;
    backlog.idle = is_idle();
    return backlog;
  }

  const LiveMap& map() {
    apply_changes();
    return map_;
  }
  std::string backend() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return backend_;
  }

 private:
  template <class Call>
  void post(const Call& call) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (stats_.failed) return;
      call();
      idle_ = false;
    }
    changed_.notify_all();
  }

  void check_image_of(const LiveKeyframe& keyframe) const { check_image(keyframe, options_.mask.get()); }

  /// Returns pose and map of a keyframe with `landmarks`, without images.
  static LiveKeyframe state_of(const LiveKeyframe& keyframe, std::vector<Landmark> landmarks) {
    LiveKeyframe state;
    state.id = keyframe.id;
    state.map_id = keyframe.map_id;
    state.cam_from_world = keyframe.cam_from_world;
    state.landmarks = std::move(landmarks);
    return state;
  }

  /// Returns copies without images. Throws InvalidInput if one is invalid.
  static std::vector<LiveKeyframe> states_of(const std::vector<LiveKeyframe>& keyframes) {
    std::vector<LiveKeyframe> states;
    states.reserve(keyframes.size());
    for (const LiveKeyframe& keyframe : keyframes) {
      check_state(keyframe);
      states.push_back(state_of(keyframe, keyframe.landmarks));
    }
    return states;
  }

  // With `mutex_` locked.

  bool knows(std::int64_t id) const { return known_.count(id) != 0; }

  void queue_new(LiveKeyframe keyframe) {
    ++stats_.added;
    ++queued_keyframes_;
    finishing_ = false;
    known_.insert(keyframe.id);
    changes_.emplace_back([this, keyframe = std::move(keyframe), serial = ++serial_]() mutable {
      tracker_.add(keyframe, serial);
      enqueue(
          {[keyframe = std::move(keyframe), serial](LiveBuilder& builder) { builder.add(keyframe, serial); }, serial});
    });
  }

  void move(std::vector<LiveKeyframe> states) {
    changes_.emplace_back([this, states = std::move(states)]() mutable {
      std::vector<LivePose> moved = tracker_.move(states);
      if (!moved.empty()) {
        map_.move(moved);
        enqueue({[moved = std::move(moved)](LiveBuilder& builder) { builder.move(moved); }});
      }
      for (LiveKeyframe& state : states) {
        if (state.landmarks.empty() || !tracker_.is_recent(state.id, kRecentKeyframes)) continue;
        enqueue({[state = std::move(state)](LiveBuilder& builder) {
          builder.set_landmarks(state.id, state.landmarks, state.cam_from_world);
        }});
      }
    });
  }

  void erase_known(const std::vector<std::int64_t>& ids) {
    std::vector<std::int64_t> erased;
    for (const std::int64_t id : ids) {
      if (known_.erase(id) != 0) erased.push_back(id);
    }
    if (erased.empty()) return;
    stats_.erased += static_cast<std::int64_t>(erased.size());
    changes_.emplace_back([this, erased = std::move(erased)] {
      for (const std::int64_t id : erased) {
        tracker_.erase(id);
        enqueue({[id](LiveBuilder& builder) { builder.erase(id); }});
      }
      map_.remove(erased);
    });
  }

  bool is_idle() const { return idle_ && queue_.empty() && changes_.empty(); }

  // ---- tracker and map ----

  using Change = std::function<void()>;
  struct Task {
    std::function<void(LiveBuilder&)> run;
    std::uint64_t serial = 0;      ///< of the keyframe that it adds; 0 = none
    std::uint64_t generation = 0;  ///< obsolete after a further reset
  };

  /// Applies all changes queued before the call.
  void apply_changes() {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    apply_changes_locked();
  }

  // With `state_mutex_` locked.

  void apply_changes_locked() {
    std::deque<Change> changes;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      changes.swap(changes_);
      applied_generation_ = generation_;
    }
    for (Change& change : changes) change();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stats_.rescaled = tracker_.rescaled();
    }
    if (!changes.empty()) changed_.notify_all();  // the worker, of tasks
  }

  void enqueue(Task task) {
    task.generation = applied_generation_;
    const std::lock_guard<std::mutex> lock(mutex_);
    queue_.push_back(std::move(task));
  }

  static LiveStats sum(LiveStats a, const LiveStats& b) {
    for (const auto member :
         {&LiveStats::used, &LiveStats::not_needed, &LiveStats::dropped_late, &LiveStats::previews,
          &LiveStats::previews_late, &LiveStats::passes, &LiveStats::matched_again, &LiveStats::clouds,
          &LiveStats::images_dropped, &LiveStats::keyframes_frozen, &LiveStats::errors}) {
      a.*member += b.*member;
    }
    a.memory_mib = b.memory_mib;
    a.lens_distance = b.lens_distance;
    a.rig = b.rig;
    return a;
  }

  // ---- worker ----

  std::unique_ptr<LiveBuilder> make_builder() {
    return std::make_unique<LiveBuilder>(
        options_, cancel_,
        [this](const KeyframeCloud& cloud, std::uint64_t serial, bool preliminary) {
          publish(cloud, serial, preliminary);
        },
        [this](const std::string& what) { report(what); });
  }

  /// Ignored if the keyframe is erased or its id reused.
  void publish(const KeyframeCloud& cloud, std::uint64_t serial, bool preliminary) {
    auto copy = std::make_shared<const KeyframeCloud>(cloud);
    LiveVersion version = 0;
    {
      const std::lock_guard<std::mutex> lock(state_mutex_);
      apply_changes_locked();
      if (tracker_.serial_of(cloud.keyframe_id) != serial) return;
      map_.publish(tracker_.pose_of(cloud.keyframe_id), std::move(copy), preliminary);
      version = map_.version();
    }
    if (callbacks_.changed) call([&] { callbacks_.changed(version); });
  }

  /// Counts exceptions of callbacks as errors.
  template <class Call>
  void call(const Call& call) {
    try {
      call();
    } catch (const std::exception& error) {
      count_error(std::string("a callback has thrown: ") + error.what());
    } catch (...) {
      count_error("a callback has thrown");
    }
  }

  void count_error(const std::string& text) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++stats_.errors;
    stats_.last_error = text;
  }

  void report(const std::string& text) {
    count_error(text);
    if (callbacks_.on_error) call([&] { callbacks_.on_error(text); });
  }

  void work() {
    std::uint64_t generation = 0;  // of the builder
    while (true) {
      {
        std::unique_lock<std::mutex> lock(mutex_);
        changed_.wait(lock, [&] {
          return stop_ || generation != generation_ || !queue_.empty() || !changes_.empty() || (!idle_ && !paused_);
        });
      }
      try {
        apply_changes();
        std::deque<Task> tasks;
        bool restart = false;
        bool paused = false;
        {
          const std::lock_guard<std::mutex> lock(mutex_);
          if (stop_) return;
          restart = generation != generation_;
          generation = generation_;
          cancel_.store(false, std::memory_order_relaxed);
          tasks.swap(queue_);
          for (const Task& task : tasks) {
            if (task.generation != generation || task.serial == 0) continue;
            taken_serial_ = task.serial;
            ++taken_keyframes_;
          }
          if (restart) stats_ = sum(stats_, worker_stats_);
          if (restart) worker_stats_ = {};
          paused = paused_;
        }
        if (restart) {
          builder_.reset();  // first, to free its memory
          builder_ = make_builder();
        }
        for (const Task& task : tasks) {
          if (task.generation == generation) task.run(*builder_);
        }
        tasks.clear();
        builder_->stay_within_memory();
        const bool busy = !paused && builder_->work();
        after(!busy && !paused);
      } catch (const std::exception& error) {
        if (!recover_from(error)) return;
      }
    }
  }

  void after(bool idle) {
    const LiveStats stats = builder_->stats();
    const LiveBacklog backlog = builder_->backlog();
    LiveVersion version = 0;
    bool is_over = false;
    {
      const std::lock_guard<std::mutex> state_lock(state_mutex_);
      std::vector<std::int64_t> dropped;
      for (const auto& [id, serial] : builder_->take_dropped()) {
        if (tracker_.serial_of(id) == serial) dropped.push_back(id);
      }
      for (const std::int64_t id : dropped) tracker_.forget_landmarks(id);
      if (map_.remove_preliminary(dropped)) version = map_.version();
      const std::lock_guard<std::mutex> lock(mutex_);
      backend_ = builder_->backend();
      queued_keyframes_ -= std::exchange(taken_keyframes_, 0);
      worker_stats_ = stats;
      backlog_ = backlog;
      idle_ = idle && !paused_ && queue_.empty() && changes_.empty();
      is_over = idle_ && finishing_;
    }
    if (is_over) trim_heap();
    if (version != 0 && callbacks_.changed) call([&] { callbacks_.changed(version); });
    if (idle) changed_.notify_all();
  }

  /// Replaces the builder. Keyframes without final points are forgotten, so that `sync` adds them again; those with
  /// final points keep them and are only moved. Returns false if no builder can be made.
  bool recover_from(const std::exception& error) {
    report(error.what());
    std::string again;
    try {
      builder_.reset();
      builder_ = make_builder();
    } catch (const std::exception& why) {
      again = why.what();
    }
    std::deque<Task> dropped_tasks;
    {
      const std::lock_guard<std::mutex> state_lock(state_mutex_);
      std::unique_lock<std::mutex> lock(mutex_, std::defer_lock);
      do {  // until no change is pending: ids that it erases may be in use again
        if (lock.owns_lock()) lock.unlock();
        apply_changes_locked();
        lock.lock();
      } while (!changes_.empty());
      stats_ = sum(stats_, worker_stats_);
      worker_stats_ = {};
      queued_keyframes_ -= std::exchange(taken_keyframes_, 0);
      stats_.failed = !again.empty();
      if (stats_.failed) queue_.swap(dropped_tasks);
      if (builder_ && finishing_) builder_->finish();
      std::set<std::int64_t> finished;
      const auto snapshot = map_.snapshot();
      for (const LiveCloud& cloud : snapshot->clouds) {
        if (!cloud.preliminary) finished.insert(cloud.keyframe_id);
      }
      std::vector<std::int64_t> forgotten;
      for (const std::int64_t id : tracker_.ids()) {
        if (finished.count(id) == 0 && tracker_.serial_of(id) <= taken_serial_) forgotten.push_back(id);
      }
      for (const std::int64_t id : forgotten) {
        tracker_.erase(id);
        known_.erase(id);
      }
      map_.remove(forgotten);
      idle_ = false;
    }
    if (!again.empty()) report(again);
    changed_.notify_all();
    return again.empty();
  }

  LiveOptions options_;
  const LiveCallbacks callbacks_;
  mutable std::mutex mutex_;  ///< for short work only
  mutable std::condition_variable changed_;
  std::set<std::int64_t> known_;  ///< keyframes of the callers
  std::deque<Change> changes_;    ///< of the callers, for `apply_changes`
  std::deque<Task> queue_;        ///< changes for the worker
  std::mutex state_mutex_;        ///< of the following three; locked before `mutex_`
  LiveTracker tracker_;
  LiveMap map_;
  std::uint64_t applied_generation_ = 0;  ///< `generation_` at the last `apply_changes`
  std::int64_t queued_keyframes_ = 0;     ///< new keyframes that are not in `backlog_`
  std::int64_t taken_keyframes_ = 0;      ///< part of `queued_keyframes_` already taken by the worker
  std::uint64_t generation_ = 0;          ///< number of resets
  bool paused_ = false;
  bool idle_ = true;
  bool stop_ = false;
  bool finishing_ = false;          ///< `finish` was called after the last keyframe
  std::uint64_t serial_ = 0;        ///< of the newest keyframe
  std::uint64_t taken_serial_ = 0;  ///< of the newest keyframe taken by the worker
  std::atomic<bool> cancel_{false};
  LiveStats stats_;         ///< without the current builder
  LiveStats worker_stats_;  ///< of the current builder
  LiveBacklog backlog_;
  std::string backend_;
  std::unique_ptr<LiveBuilder> builder_;  ///< of the worker while it runs
  std::thread worker_;
};

LiveDensifier::LiveDensifier(const LiveOptions& options, LiveCallbacks callbacks)
    : impl_(std::make_unique<Impl>(options, std::move(callbacks))) {}
LiveDensifier::~LiveDensifier() = default;

void LiveDensifier::add(LiveKeyframe keyframe) { impl_->add(std::move(keyframe)); }
void LiveDensifier::update(const std::vector<LiveKeyframe>& keyframes) { impl_->update(keyframes); }
void LiveDensifier::sync(const std::vector<LiveKeyframe>& keyframes) { impl_->sync(keyframes); }
void LiveDensifier::erase(const std::vector<std::int64_t>& ids) { impl_->erase(ids); }
void LiveDensifier::reset() { impl_->reset(); }
void LiveDensifier::pause() { impl_->set_paused(true); }
void LiveDensifier::resume() { impl_->set_paused(false); }
void LiveDensifier::finish() { impl_->finish(); }
bool LiveDensifier::wait(std::chrono::milliseconds at_most) const { return impl_->wait(at_most); }
std::shared_ptr<const LiveSnapshot> LiveDensifier::snapshot() const { return impl_->map().snapshot(); }
LiveChanges LiveDensifier::changes_since(LiveVersion version) const { return impl_->map().changes_since(version); }
LiveStats LiveDensifier::stats() const { return impl_->stats(); }
LiveBacklog LiveDensifier::backlog() const { return impl_->backlog(); }
std::string LiveDensifier::backend() const { return impl_->backend(); }

}  // namespace pmsp
