// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "pmsp/io/images.h"
#include "run_progress.h"

namespace pmsp::tool {

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

  /// For programs only.
  void event(const nlohmann::ordered_json& event);

  /// Final event for programs; `summary` lines go through `message`.
  void done(const nlohmann::ordered_json& result);

 private:
  void tell(const std::string& line);
  void warn(const std::string& text);
  void emit(const nlohmann::ordered_json& event);
  double seconds_left(double share);
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
  Clock::time_point start_, told_;
};

/// Returns "1 h 02 min", "3 min 05 s", "12 s".
std::string duration_text(double seconds);

/// Returns "1 234 567".
std::string count_text(std::int64_t count);

}  // namespace pmsp::tool
