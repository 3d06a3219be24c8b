// SPDX-License-Identifier: BSD-2-Clause
#include "progress.h"

#include <sys/ioctl.h>
#include <unistd.h>
#include <algorithm>
#include <cmath>
#include <iostream>

#include "numbers.h"

namespace pmsp::tool {

RunProgress run_progress_of(const DensifierStats& stats, std::size_t keyframes) {
  const double known = stats.work_done + stats.work_remaining;
  const auto added = static_cast<double>(std::max<std::int64_t>(stats.keyframes_added, 1));
  const double all = known * std::max(static_cast<double>(keyframes) / added, 1.0);
  return {all > 0.0 ? std::clamp(stats.work_done / all, 0.0, 1.0) : 0.0, stats.depth_maps, stats.pixels_matched,
          stats.points};
}

std::string run_progress_text(const RunProgress& run_progress, double seconds_left) {
  std::string text = std::to_string(std::lround(100.0 * run_progress.share)) + " %";
  if (seconds_left >= 0.0) text += ", " + duration_text(seconds_left) + " left";
  if (run_progress.depth_maps > 0) {
    text +=
        "; " + std::to_string(run_progress.depth_maps) + (run_progress.depth_maps == 1 ? " depth map" : " depth maps");
  }
  // Pixels while there are no points yet; both do not fit into a line.
  if (run_progress.points > 0) {
    text += ", " + short_count(run_progress.points) + " points";
  } else if (run_progress.pixels > 0) {
    text += ", " + short_count(run_progress.pixels) + " pixels";
  }
  return text;
}

std::string short_count(std::int64_t count) {
  if (count < 10'000) return count_text(count);
  const auto number = static_cast<double>(count);
  return count < 1'000'000 ? number_text(1e-3 * number, "%.0f k") : number_text(1e-6 * number, "%.1f M");
}

std::size_t terminal_columns(int descriptor, std::size_t fallback) {
  winsize size = {};
  return ioctl(descriptor, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : fallback;
}

namespace {

/// `seconds_left` < 0: unknown.
nlohmann::ordered_json standing_json(const RunProgress& run_progress, double seconds_left) {
  nlohmann::ordered_json json{{"share", run_progress.share},
                              {"depth_maps", run_progress.depth_maps},
                              {"pixels", run_progress.pixels},
                              {"points", run_progress.points}};
  if (seconds_left >= 0.0) json["seconds_left"] = seconds_left;
  return json;
}

}  // namespace

std::string duration_text(double seconds) {
  const auto whole = static_cast<long>(std::lround(std::max(seconds, 0.0)));
  if (whole >= 3600) return format("%ld h %02ld min", whole / 3600, whole / 60 % 60);
  if (whole >= 60) return format("%ld min %02ld s", whole / 60, whole % 60);
  return format("%ld s", whole);
}

std::string count_text(std::int64_t count) {
  std::string text = std::to_string(count);
  for (auto at = static_cast<std::ptrdiff_t>(text.size()) - 3; at > 0 && text[static_cast<std::size_t>(at) - 1] != '-';
       at -= 3) {
    text.insert(static_cast<std::size_t>(at), " ");
  }
  return text;
}

Progress::Progress(ProgressMode mode, bool quiet, bool verbose) : mode_(mode), quiet_(quiet), verbose_(verbose) {
  if (mode_ == ProgressMode::kAuto) mode_ = isatty(STDERR_FILENO) != 0 ? ProgressMode::kBar : ProgressMode::kPlain;
  if (quiet_ && mode_ != ProgressMode::kJson) mode_ = ProgressMode::kNone;
}

Progress::~Progress() { clear_bar(); }

void Progress::message(const std::string& text) {
  if (quiet_ || mode_ == ProgressMode::kNone) return;
  if (mode_ == ProgressMode::kJson) return emit({{"event", "message"}, {"text", text}});
  tell(text);
}

void Progress::warning(const std::string& text) {
  if (std::find(warnings_.begin(), warnings_.end(), text) != warnings_.end()) return;
  warnings_.push_back(text);
  warn(text);
}

void Progress::skipped(const SkippedKeyframe& keyframe) {
  warn("keyframe " + std::to_string(keyframe.keyframe_id) + " skipped: " + keyframe.reason);
}

void Progress::warn(const std::string& text) {
  if (mode_ == ProgressMode::kJson) return emit({{"event", "warning"}, {"text", text}});
  tell("warning: " + text);
}

void Progress::stage(const std::string& name) {
  stage_ = name;
  last_observed_ = {};
  observe(-1.0, -1.0);
  if (mode_ == ProgressMode::kJson) return emit({{"event", "stage"}, {"stage", name}});
  if (mode_ == ProgressMode::kNone) return;
  if (mode_ != ProgressMode::kBar) return tell(name);
  clear_bar();
  std::cerr << name + " ...";
  bar_shown_ = true;
}

/// Work before the first call is ignored: its time includes other activities.
double Progress::seconds_left(double share) {
  const Clock::time_point now = Clock::now();
  if (!started_) {
    started_ = true;
    start_ = now;
    share_at_start_ = share;
  }
  const double done = share - share_at_start_;
  if (!(done > 0.0)) return -1.0;
  return std::chrono::duration<double>(now - start_).count() * std::max(1.0 - share, 0.0) / done;
}

void Progress::observe(double share, double seconds_left) {
  constexpr double kSeconds = 0.5;
  const Clock::time_point now = Clock::now();
  if (!observer_ || std::chrono::duration<double>(now - last_observed_).count() < kSeconds) return;
  last_observed_ = now;
  observer_(stage_, share, seconds_left);
}

bool Progress::is_due(double seconds) {
  const Clock::time_point now = Clock::now();
  if (std::chrono::duration<double>(now - last_output_).count() < seconds) return false;
  last_output_ = now;
  return true;
}

void Progress::step(const ProgressStep& step) {
  const double left = seconds_left(step.run_progress.share);
  stage_ = step.stage;
  observe(step.run_progress.share, left);
  last_output_ = Clock::now();
  if (mode_ == ProgressMode::kJson) {
    nlohmann::ordered_json event{{"event", "keyframe"},
                                 {"stage", step.stage},
                                 {"index", step.index},
                                 {"count", step.count},
                                 {"keyframe_id", step.keyframe_id},
                                 {"accepted", step.accepted}};
    event.update(standing_json(step.run_progress, left));
    if (step.index > 1) {
      event["seconds_per_keyframe"] = seconds_since(start_) / static_cast<double>(step.index - 1);
    }
    return emit(event);
  }
  bar_name_ = step.stage;
  const std::string count = std::to_string(step.index) + "/" + std::to_string(step.count);
  bar_count_ = step.index < step.count ? count : "";  // all keyframes were added, work continues
  if (mode_ == ProgressMode::kBar && !verbose_) return draw_bar(step.run_progress, left);
  if (mode_ == ProgressMode::kNone) return;
  tell(step.stage + ": keyframe " + count + " (id " + std::to_string(step.keyframe_id) + ", " +
       (step.accepted ? "used" : "left out by the view filter") + "), " + run_progress_text(step.run_progress, left));
}

void Progress::run_progress(const RunProgress& run_progress, bool is_end) {
  constexpr double kBarSeconds = 0.1, kJsonSeconds = 1.0, kLineSeconds = 10.0;
  const bool has_bar = mode_ == ProgressMode::kBar && !verbose_;
  const double left = seconds_left(run_progress.share);
  observe(run_progress.share, left);
  if (mode_ == ProgressMode::kNone) return;
  const bool skips_message = is_end && mode_ == ProgressMode::kJson;
  if (!skips_message && !is_due(has_bar ? kBarSeconds : mode_ == ProgressMode::kJson ? kJsonSeconds : kLineSeconds))
    return;
  if (mode_ == ProgressMode::kJson) {
    nlohmann::ordered_json event{{"event", "progress"}};
    event.update(standing_json(run_progress, left));
    return emit(event);
  }
  if (has_bar) return draw_bar(run_progress, left);
  tell(run_progress_text(run_progress, left));
}

void Progress::event(const nlohmann::ordered_json& event) {
  if (mode_ == ProgressMode::kJson) emit(event);
}

void Progress::done(const nlohmann::ordered_json& result) {
  if (mode_ != ProgressMode::kJson) return clear_bar();
  nlohmann::ordered_json event{{"event", "done"}};
  event.update(result);
  emit(event);
}

/// In one write, since stderr is unbuffered.
void Progress::tell(const std::string& line) {
  clear_bar();
  std::cerr << line + "\n";
}

void Progress::emit(const nlohmann::ordered_json& event) {
  std::cout << event.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n" << std::flush;
}

void Progress::draw_bar(const RunProgress& run_progress, double seconds_left) {
  const std::size_t columns = terminal_columns(STDERR_FILENO, 80);
  const std::string head = bar_name_ + (bar_count_.empty() ? "" : ": keyframe " + bar_count_);
  const std::string tail = " " + run_progress_text(run_progress, seconds_left);
  const std::size_t taken = head.size() + tail.size() + 4;
  const std::size_t width = columns > taken + 10 ? std::min<std::size_t>(columns - taken, 30) : 10;
  const auto full = static_cast<std::size_t>(static_cast<double>(width) * std::clamp(run_progress.share, 0.0, 1.0));
  std::string line = head + " [" + std::string(full, '#') + std::string(width - full, '.') + "]" + tail;
  if (line.size() >= columns) line.resize(columns - 1);
  std::cerr << "\r\033[K" + line << std::flush;
  bar_shown_ = true;
}

void Progress::clear_bar() {
  if (bar_shown_) std::cerr << "\r\033[K" << std::flush;
  bar_shown_ = false;
}

}  // namespace pmsp::tool
