// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "pmsp/densifier.h"
#include "pmsp/io/images.h"

namespace pmsp::tool {

/// Progress of a run.
struct RunProgress {
  double share = 0.0;           ///< of the expected work, 0 to 1
  std::int64_t depth_maps = 0;  ///< matched
  std::int64_t pixels = 0;      ///< with a depth, in these
  std::int64_t points = 0;      ///< in the cloud so far; most presets hold them back
};

/// `keyframes`: expected total; future ones are assumed to be like previous ones.
RunProgress run_progress_of(const DensifierStats& stats, std::size_t keyframes);

/// Returns "1.2 M" for 1234567.
std::string short_count(std::int64_t count);

/// Returns "37 %, 1 min 05 s left; 8 depth maps, 6.1 M pixels, 210 k points", without zero counts. `seconds_left` < 0:
/// unknown.
std::string run_progress_text(const RunProgress& run_progress, double seconds_left);

/// Returns the width of a terminal; `fallback` if it is none.
std::size_t terminal_columns(int descriptor, std::size_t fallback);

/// State of a run after a keyframe.
struct ProgressStep {
  std::string stage;      ///< "densify", ...
  std::size_t index = 0;  ///< keyframes so far
  std::size_t count = 0;  ///< total number of keyframes
  std::int64_t keyframe_id = 0;
  bool accepted = false;  ///< by the view filter
  RunProgress run_progress;
};

/// Reports progress to people on stderr, or to programs on stdout (JSON lines).
class Progress {
 public:
  Progress(ProgressMode mode, bool quiet, bool verbose);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void message(const std::string& text);
  /// Possible cause of a wrong result; recorded once for summary, report and statistics.
  void warning(const std::string& text);
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Keyframe without a usable image; not recorded.
  void skipped(const SkippedKeyframe& keyframe);
  void step(const ProgressStep& step);

  /// Between steps or after the last one; output is rate-limited, except the last one for programs.
  void run_progress(const RunProgress& run_progress, bool is_end = false);

  /// Stage of some duration without steps: "writing cloud.ply".
  void stage(const std::string& name);

  /// Also reports stages, and progress at most twice a second, to `observer`. `share`, `seconds_left` < 0: unknown.
  using Observer = std::function<void(const std::string& stage, double share, double seconds_left)>;
  void set_observer(Observer observer) { observer_ = std::move(observer); }

  /// For programs only.
  void event(const nlohmann::ordered_json& event);

  /// Final event for programs; `summary` lines go through `message`.
  void done(const nlohmann::ordered_json& result);

 private:
  void tell(const std::string& line);
  void warn(const std::string& text);
  void emit(const nlohmann::ordered_json& event);
  double seconds_left(double share);
  void observe(double share, double seconds_left);
  bool is_due(double seconds);
  void draw_bar(const RunProgress& run_progress, double seconds_left);
  void clear_bar();

  ProgressMode mode_;
  bool quiet_;
  bool verbose_;
  std::vector<std::string> warnings_;
  bool bar_shown_ = false;
  std::string bar_name_;   ///< stage shown by the bar
  std::string bar_count_;  ///< keyframes so far; "" = all
  using Clock = std::chrono::steady_clock;
  bool started_ = false;
  double share_at_start_ = 0.0;
  Clock::time_point start_, last_output_, last_observed_;
  Observer observer_;
  std::string stage_;  ///< current one
};

/// Returns "1 h 02 min", "3 min 05 s", "12 s".
std::string duration_text(double seconds);

/// Returns "1 234 567".
std::string count_text(std::int64_t count);

inline double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Activity of a run's main thread, or reason of its waiting; other threads are not accounted.
enum class Activity {
  kOther,
  kMap,        ///< reading the map
  kImages,     ///< finding the images of keyframes
  kStart,      ///< creating a Densifier: threads, or CUDA context
  kWait,       ///< for images being read and verified
  kDensify,    ///< stages on the CPU, or waiting for a device
  kPoints,     ///< encoding points, waiting for the writing thread
  kDepthMaps,  ///< encoding and writing
  kWorkspace,  ///< reading and writing a workspace, waiting for the disk
  kPreview,    ///< drawing
  kFinish,     ///< until all data are on disk
};
constexpr std::size_t kBusyKinds = static_cast<std::size_t>(Activity::kFinish) + 1;

/// Time of a run by activity: each moment counts for the innermost open scope, so the sum is the total. For one thread.
class TimeAccount {
 public:
  class Scope {
   public:
    Scope(TimeAccount& account, Activity with) : Scope(&account, with) {}
    /// nullptr = no account.
    Scope(TimeAccount* account, Activity with) : account_(account) {
      if (account_ == nullptr) return;
      before_ = account_->now_;
      account_->switch_to(with);
    }
    ~Scope() {
      if (account_ != nullptr) account_->switch_to(before_);
    }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    TimeAccount* account_;
    Activity before_ = Activity::kOther;
  };

  /// Seconds up to now.
  double seconds(Activity with) const {
    const double before = seconds_[static_cast<std::size_t>(with)];
    return with == now_ ? before + seconds_since(since_) : before;
  }

  double total() const { return seconds_since(begin_); }

 private:
  using Clock = std::chrono::steady_clock;

  void switch_to(Activity with) {
    seconds_[static_cast<std::size_t>(now_)] = seconds(now_);
    since_ = Clock::now();
    now_ = with;
  }

  std::array<double, kBusyKinds> seconds_{};
  Activity now_ = Activity::kOther;
  const Clock::time_point begin_ = Clock::now();
  Clock::time_point since_ = begin_;
};

}  // namespace pmsp::tool
