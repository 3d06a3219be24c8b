// SPDX-License-Identifier: BSD-2-Clause
#include "run_progress.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "progress.h"

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
  char text[32];
  if (count < 1'000'000) {
    std::snprintf(text, sizeof(text), "%.0f k", static_cast<double>(count) * 1e-3);
  } else {
    std::snprintf(text, sizeof(text), "%.1f M", static_cast<double>(count) * 1e-6);
  }
  return text;
}

}  // namespace pmsp::tool
