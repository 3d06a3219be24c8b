// SPDX-License-Identifier: BSD-2-Clause
#include "progress.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>

#include <sys/ioctl.h>
#include <unistd.h>

namespace pmsp::tool {
namespace {

std::size_t terminal_columns() {
  winsize size = {};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, value);
  return text;
}

}  // namespace

std::string duration_text(double seconds) {
  const auto whole = static_cast<long>(std::lround(std::max(seconds, 0.0)));
  char text[64];
  if (whole >= 3600) {
    std::snprintf(text, sizeof(text), "%ld h %02ld min", whole / 3600, whole / 60 % 60);
  } else if (whole >= 60) {
    std::snprintf(text, sizeof(text), "%ld min %02ld s", whole / 60, whole % 60);
  } else {
    std::snprintf(text, sizeof(text), "%ld s", whole);
  }
  return text;
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
  clear_bar();
  std::cerr << text << "\n";
}

void Progress::warning(const std::string& text) {
  if (mode_ == ProgressMode::kJson) return emit({{"event", "warning"}, {"text", text}});
  clear_bar();
  std::cerr << "warning: " << text << "\n";
}

void Progress::stage(const std::string& name) {
  if (mode_ == ProgressMode::kJson) return emit({{"event", "stage"}, {"stage", name}});
  if (mode_ == ProgressMode::kNone) return;
  clear_bar();
  if (mode_ == ProgressMode::kBar) {
    std::cerr << name << " ...";
    bar_shown_ = true;
  } else {
    std::cerr << name << "\n";
  }
}

void Progress::step(const ProgressStep& step) {
  const auto now = std::chrono::steady_clock::now();
  if (!started_) start_ = now;
  // The first step only starts the clock: its own work happened before.
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const bool known = started_ && step.index > 1;
  const double each = known ? seconds / static_cast<double>(step.index - 1) : 0.0;
  const double left = each * static_cast<double>(step.count - std::min(step.index, step.count));
  started_ = true;
  if (mode_ == ProgressMode::kJson) {
    nlohmann::ordered_json event{{"event", "keyframe"},
                                 {"stage", step.stage},
                                 {"index", step.index},
                                 {"count", step.count},
                                 {"keyframe_id", step.keyframe_id},
                                 {"accepted", step.accepted},
                                 {"points", step.points}};
    if (known) {
      event["seconds_per_keyframe"] = each;
      event["seconds_left"] = left;
    }
    return emit(event);
  }
  if (mode_ == ProgressMode::kBar && !verbose_) return draw_bar(step, each, left);
  if (mode_ == ProgressMode::kNone) return;
  clear_bar();
  std::cerr << step.stage << ": keyframe " << step.index << "/" << step.count << " (id " << step.keyframe_id << ", "
            << (step.accepted ? "used" : "left out by the view filter") << "), " << count_text(step.points)
            << " points";
  if (known) std::cerr << ", " << format("%.2f", each) << " s each, " << duration_text(left) << " left";
  std::cerr << "\n";
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

void Progress::emit(const nlohmann::ordered_json& event) {
  std::cout << event.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << "\n" << std::flush;
}

void Progress::draw_bar(const ProgressStep& step, double seconds_each, double seconds_left) {
  const std::size_t columns = terminal_columns();
  std::string tail =
      " " + std::to_string(step.index) + "/" + std::to_string(step.count) + "  " + count_text(step.points) + " points";
  if (seconds_each > 0.0) {
    tail += "  " + format("%.2f", seconds_each) + " s each  " + duration_text(seconds_left) + " left";
  }
  const std::size_t taken = step.stage.size() + tail.size() + 4;
  const std::size_t width = columns > taken + 10 ? std::min<std::size_t>(columns - taken, 40) : 10;
  const std::size_t full = step.count == 0 ? 0 : width * std::min(step.index, step.count) / step.count;
  std::string line = step.stage + " [" + std::string(full, '#') + std::string(width - full, '.') + "]" + tail;
  if (line.size() >= columns) line.resize(columns - 1);
  std::cerr << "\r\033[K" << line << std::flush;
  bar_shown_ = true;
}

void Progress::clear_bar() {
  if (bar_shown_) std::cerr << "\r\033[K" << std::flush;
  bar_shown_ = false;
}

}  // namespace pmsp::tool
