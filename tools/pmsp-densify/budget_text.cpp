// SPDX-License-Identifier: BSD-2-Clause
#include "budget_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "progress.h"

namespace pmsp::tool {
namespace {

std::string time_text(double seconds) {
  char text[48];
  if (seconds < 100.0) {
    std::snprintf(text, sizeof(text), "%.0f s", std::ceil(seconds));
  } else if (seconds < 6000.0) {
    std::snprintf(text, sizeof(text), "%.0f min", seconds / 60.0);
  } else {
    std::snprintf(text, sizeof(text), "%.1f h", seconds / 3600.0);
  }
  return text;
}

constexpr double kMinAnnouncedSeconds = 30.0;  ///< minimum time for an announcement [s]
constexpr double kFastestPace = 1.5e-6;        ///< CPU time per pixel and source view, below that of any CPU [s]

/// Expected CPU time [s]; 0 = clearly below kMinAnnouncedSeconds.
double expected_seconds(const SlamMap& map, const ImageSource& source, const DensifierOptions& options) {
  const Plan plan = make_plan(keyframes_without_image(map, &source, options), options);
  Budget budget = estimate_budget({map, plan, options, 0, 0, {kFastestPace, 0.0, 0.0}});
  if (budget.cpu_seconds < kMinAnnouncedSeconds * budget.threads) return 0.0;
  budget = estimate_budget({map, plan, options, 0, 0, measure_cpu_pace(options)});
  return budget.cpu_seconds / budget.threads;
}

std::int64_t whole(double number) { return static_cast<std::int64_t>(std::llround(number)); }

}  // namespace

std::string bytes_text(double bytes) {
  const char* unit = "MiB";
  double number = bytes / (1024.0 * 1024.0);
  for (const char* larger : {"GiB", "TiB"}) {
    if (number < 1000.0) break;
    number /= 1024.0;
    unit = larger;
  }
  char text[48];
  std::snprintf(text, sizeof(text), number < 10.0 ? "%.1f %s" : "%.0f %s", number, unit);
  return text;
}

nlohmann::ordered_json to_json(const Budget& b) {
  return {{"width", b.width},
          {"height", b.height},
          {"keyframes", b.keyframes},
          {"used", b.used},
          {"depth_maps", b.depth_maps},
          {"views", b.views},
          {"points_per_pixel", b.points_per_pixel},
          {"points", whole(b.points)},
          {"cloud_bytes", whole(b.cloud_bytes)},
          {"workspace_bytes", whole(b.workspace_bytes)},
          {"scratch_bytes", whole(b.memory.scratch)},
          {"cpu",
           {{"memory_bytes", whole(b.memory.host)},
            {"threads", b.threads},
            {"cpu_seconds", b.cpu_seconds},
            {"seconds", b.cpu_seconds / b.threads}}},
          {"gpu",
           {{"memory_bytes", whole(b.memory.gpu_host)},
            {"device_bytes", whole(b.device.all)},
            {"least_device_bytes", whole(b.device.least)},
            {"reference", kReferenceGpu},
            {"reference_seconds", b.reference_seconds}}}};
}

std::string budget_text(const Budget& b) {
  const std::string size = std::to_string(b.width) + " x " + std::to_string(b.height);
  char points[160];
  std::snprintf(points, sizeof(points), " points (%.2f a pixel)", b.points_per_pixel);
  std::string text = "a run:      " + std::to_string(b.depth_maps) + " depth maps of " + size + " px; about " +
                     count_text(whole(b.points)) + points + ", usually within 30 %\n";
  text += "  disk:     cloud " + bytes_text(b.cloud_bytes);
  if (b.memory.scratch > 0.0) text += ", temporary data " + bytes_text(b.memory.scratch);
  text += ", workspace (if used) " + bytes_text(b.workspace_bytes) + "\n";
  text += "  CPU:      " + time_text(b.cpu_seconds / b.threads) + " on " + std::to_string(b.threads) +
          (b.threads == 1 ? " thread" : " threads") + " (" + time_text(b.cpu_seconds) +
          " of CPU time, by a benchmark on this machine), " + bytes_text(b.memory.host) + " of memory\n";
  text += "  GPU:      " + bytes_text(b.device.all) + " of GPU memory";
  if (b.device.least < 0.9 * b.device.all)
    text += " (at least " + bytes_text(b.device.least) + ", with temporary data)";
  text += ", " + bytes_text(b.memory.gpu_host) + " of host memory; " + time_text(b.reference_seconds) + " with an " +
          kReferenceGpu + "\n";
  return text;
}

std::string cpu_time_text(const SlamMap& map, const ImageSource& source, const DensifierOptions& options,
                          const DensifierOptions& online) {
  const double seconds = expected_seconds(map, source, options);
  if (seconds < kMinAnnouncedSeconds) return "";
  const double faster = expected_seconds(map, source, online);
  const std::string text = "time: about " + time_text(seconds) + " on this CPU";
  if (faster > 0.7 * seconds) return text;
  return text + "; with --quality online " + (faster > 0.0 ? "about " : "below ") +
         time_text(std::max(faster, kMinAnnouncedSeconds));
}

}  // namespace pmsp::tool
