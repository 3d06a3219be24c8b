// SPDX-License-Identifier: BSD-2-Clause
#include "stats.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "arguments.h"
#include "numbers.h"
#include "options.h"
#include "process.h"
#include "progress.h"

namespace pmsp::tool {
namespace {

std::string percent_text(std::int64_t part, std::int64_t whole) {
  const double percent = whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0;
  return number_text(percent, "%.1f %%");
}

std::string blurred_keyframes(const DensifierStats& s) {
  return s.keyframes_blurred > 0 ? ", " + std::to_string(s.keyframes_blurred) + " rejected as blurred" : "";
}

/// Reasons why accepted keyframes have no depth map; "" = all have one.
std::string without_depth_map(const DensifierStats& s) {
  std::string text;
  const auto add = [&text](std::int64_t count, const char* why) {
    if (count > 0) text += ", " + std::to_string(count) + " without one (" + why + ")";
  };
  add(s.keyframes_without_neighbour, "no source view");
  add(s.keyframes_without_range, "too few landmarks for a depth range");
  return text;
}

std::string repeated_points(const DensifierStats& s) {
  return s.points_repeated > 0 ? "; " + count_text(s.points_repeated) + " duplicates removed" : "";
}

/// Effect of --crop, --voxel and --max-points.
std::string left_out(const RunReport& report) {
  if (report.points_written == report.stats.points) return "";
  return "; " + count_text(report.points_written) + " of them written (--crop, --voxel, --max-points)";
}

/// A line; "" if counts do not cover the whole mission.
std::string pixels_kept(const RunReport& report) {
  const DensifierStats& s = report.stats;
  if (!report.workspace.is_null()) return "";
  return "pixels kept: " + std::string(report.external_depths.is_null() ? "PatchMatch " : "depth images ") +
         percent_text(s.pixels_matched, s.pixels) + ", median filter " + percent_text(s.pixels_after_median, s.pixels) +
         ", consistency filter " + percent_text(s.pixels_after_consistency, s.pixels) + " of " + count_text(s.pixels) +
         (1000 * s.pixels_far >= s.pixels && s.pixels_far > 0 ? "; sky " + percent_text(s.pixels_far, s.pixels) : "") +
         "\n";
}

std::string seconds_text(double seconds) { return number_text(seconds, "%.1f s"); }

/// Indexed by Activity.
constexpr struct {
  const char* key;
  const char* words;
} kBusyNames[kBusyKinds] = {{"other", "other"},
                            {"map", "reading the map"},
                            {"images", "finding images"},
                            {"start", "starting the backend"},
                            {"wait_for_images", "waiting for images"},
                            {"densify", "densifying"},
                            {"points", "writing points"},
                            {"depth_maps", "writing depth maps"},
                            {"workspace", "writing and reading the workspace"},
                            {"preview", "drawing"},
                            {"finish", "waiting for the disk"}};

/// In order; stages below 1 % of the total are omitted.
std::string stages_of(const DensifierStats& s) {
  const std::pair<const char*, double> stages[] = {
      {"prepare", s.seconds_prepare},         {"init", s.seconds_init},
      {"PatchMatch", s.seconds_patchmatch},   {"median", s.seconds_median},
      {"consistency", s.seconds_consistency}, {"fusion", s.seconds_fusion},
      {"free space", s.seconds_free_space},   {"duplicate removal", s.seconds_duplicates}};
  double all = 0.0;
  for (const auto& [name, seconds] : stages) all += seconds;
  std::string text;
  for (const auto& [name, seconds] : stages) {
    if (seconds > 0.01 * all) text += (text.empty() ? "" : ", ") + std::string(name) + " " + seconds_text(seconds);
  }
  return text.empty() ? "none" : text;
}

/// Returns "densifying 82 %, waiting for images 12 %, ...", descending, without those below 1 %.
std::string shares_of(const TimeAccount& time) {
  std::vector<std::pair<double, const char*>> shares;
  for (std::size_t i = 0; i < kBusyKinds; ++i) {
    shares.emplace_back(100.0 * time.seconds(static_cast<Activity>(i)) / std::max(time.total(), 1e-9),
                        kBusyNames[i].words);
  }
  std::stable_sort(shares.begin(), shares.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::string text;
  for (const auto& [percent, words] : shares) {
    if (percent < 1.0) continue;
    text += (text.empty() ? "" : ", ") + std::string(words) + number_text(percent, " %.0f %%");
  }
  return text;
}

}  // namespace

nlohmann::ordered_json to_json(const RunReport& report) {
  const DensifierStats& s = report.stats;
  nlohmann::ordered_json json{{"generator", version_text()},
                              {"build_type", PMSP_BUILD_TYPE},
                              {"backend", name_of(report.options.backend)},
                              {"simd", name_of(report.options.simd)},
                              {"threads", report.options.threads},
                              {"seed", report.options.seed},
                              {"map", report.map},
                              {"images", report.images},
                              {"output", report.outputs.empty() ? "" : report.outputs.front()},
                              {"outputs", report.outputs},
                              {"cloud", report.cloud},
                              {"options", to_json(report.options)}};
  json["keyframes"] = {{"in_map", report.keyframes},
                       {"with_image", report.with_image},
                       {"added", s.keyframes_added},
                       {"accepted", s.keyframes_accepted},
                       {"rejected", s.keyframes_rejected},
                       {"blurred", s.keyframes_blurred},
                       {"depth_maps", s.depth_maps},
                       {"without_neighbour", s.keyframes_without_neighbour},
                       {"without_range", s.keyframes_without_range}};
  json["pixels"] = {{"unmasked", s.pixels},
                    {"matched", s.pixels_matched},
                    {"after_median", s.pixels_after_median},
                    {"after_consistency", s.pixels_after_consistency},
                    {"far", s.pixels_far}};
  json["points_fused"] = s.points_fused;
  json["points_repeated"] = s.points_repeated;
  json["points"] = s.points;
  json["points_written"] = report.points_written;
  if (s.points > 0) json["confidence"] = report.confidence;
  if (const std::int64_t near = s.pixels - s.pixels_far; near > 0) {
    json["coverage"] = static_cast<double>(s.pixels_after_consistency) / static_cast<double>(near);
  }
  json["seconds"] = {{"total", report.time.total()},
                     {"prepare", s.seconds_prepare},
                     {"init", s.seconds_init},
                     {"patchmatch", s.seconds_patchmatch},
                     {"median", s.seconds_median},
                     {"consistency", s.seconds_consistency},
                     {"fusion", s.seconds_fusion},
                     {"free_space", s.seconds_free_space},
                     {"duplicates", s.seconds_duplicates}};
  for (std::size_t i = 0; i < kBusyKinds; ++i) {
    json["critical_path"][kBusyNames[i].key] = report.time.seconds(static_cast<Activity>(i));
  }
  const bool on_device = report.options.backend == Backend::kCuda;
  if (on_device && report.device_start) json["device_start"] = *report.device_start;
  json["peak_memory_mib"] = peak_memory_mib();
  if (!report.masks.json.is_null()) json["mask"] = report.masks.json;
  if (report.calibration.lenses) {
    const LensDistance& it = *report.calibration.lenses;
    json["lenses"] = {{"distance", it.distance},
                      {"standard_error", it.standard_error},
                      {"shift_px_of_1920", it.shift_px},
                      {"landmarks", it.landmarks},
                      {"corrected", it.significant}};
  }
  if (!report.calibration.rig.mask.empty()) json["rig"] = {{"hidden", report.calibration.rig.share}};
  if (report.pairing) {
    json["pairing"] = {{"comparisons", report.pairing->comparisons}, {"agreement", report.pairing->agreement},
                       {"by_chance", report.pairing->by_chance},     {"fit", report.pairing->fit},
                       {"conclusive", report.pairing->conclusive},   {"belongs", report.pairing->belongs},
                       {"doubtful", report.pairing->doubtful},       {"message", report.pairing->message}};
  }
  json["warnings"] = report.warnings;
  json["skipped"] = nlohmann::ordered_json::array();
  for (const SkippedKeyframe& skipped : report.skipped) {
    json["skipped"].push_back({{"keyframe_id", skipped.keyframe_id}, {"reason", skipped.reason}});
  }
  if (!report.prior_depth.is_null()) json["prior_depth"] = report.prior_depth;
  if (!report.external_depths.is_null()) json["external_depths"] = report.external_depths;
  if (!report.workspace.is_null()) json["workspace"] = report.workspace;
  if (!report.empty_reason.empty()) json["empty"] = report.empty_reason;
  return json;
}

std::string summary(const RunReport& report) {
  const DensifierStats& s = report.stats;
  const double total = report.time.total();
  std::string warnings;
  for (const std::string& warning : report.warnings) warnings += "\nwarning:     " + warning;
  const auto rate = s.keyframes_added > 0 ? total / static_cast<double>(s.keyframes_added) : 0.0;
  return "keyframes:   " + std::to_string(report.keyframes) + " in the map, " + std::to_string(report.with_image) +
         (report.external_depths.is_null() ? " with an image, " : " with an image and a depth image, ") +
         std::to_string(s.keyframes_accepted) + " accepted by the view filter" + blurred_keyframes(s) + ", " +
         std::to_string(s.depth_maps) + " depth maps" + without_depth_map(s) + "\n" +
         (report.masks.text.empty() ? "" : "masks:       " + report.masks.text + "\n") + pixels_kept(report) +
         "points:      " + count_text(s.points) + repeated_points(s) + left_out(report) + "\n" +
         "stages:      " + stages_of(s) + "\n" + "time:        " + seconds_text(total) + " (" +
         number_text(rate, "%.2f") + " s a keyframe): " + shares_of(report.time) + "; " +
         std::to_string(static_cast<long>(peak_memory_mib())) + " MiB of memory" + warnings;
}

std::string consistency_warning(const DensifierStats& s) {
  const std::int64_t kept = s.pixels_after_consistency + s.pixels_far;
  if (kept == 0 || 5 * kept >= s.pixels_after_median) return "";
  return "the consistency filter keeps only " + percent_text(kept, s.pixels_after_median) +
         " of the pixels: depth maps contradict each other, as with inexact poses, wrong pairing of images, or a "
         "moving scene; inspect the report (--report) before using the cloud";
}

std::string explain_empty(const DensifierStats& s) {
  if (s.keyframes_added == 0) {
    return "no keyframe has an image, see the warnings; check --images or --video, --frame-offset and --fps";
  }
  if (s.depth_maps == 0 && s.keyframes_without_range > 0) {
    return "the map has no landmarks in " + std::to_string(s.keyframes_without_range) +
           " keyframe(s), so that there is no depth range; save the map with its landmarks (`pmsp-densify info` "
           "counts them)";
  }
  if (s.depth_maps == 0) {
    return "the view filter left " + std::to_string(s.keyframes_accepted) +
           " keyframe(s), none with a source view; try --view-filter-min-share 0.05 or "
           "--no-view-filter-enabled";
  }
  if (s.pixels == 0) return "the mask covers every pixel; check --mask (black is ignored, white is used)";
  if (s.pixels_matched == 0) {
    return "PatchMatch matched no pixel; try --init-range-margin 10 or --patchmatch-iterations 8";
  }
  if (s.pixels_after_median == 0) {
    return "the median filter dropped all " + std::to_string(s.pixels_matched) +
           " pixels; try --median-min-score -1 or --no-median-enabled";
  }
  if (s.pixels_after_consistency == 0) {
    return "the consistency filter dropped all " + std::to_string(s.pixels_after_median) +
           " pixels; try --consistency-min-views 2 or --consistency-max-relative-depth 0.05";
  }
  if (s.points_fused == 0) {
    return "fusion kept none of " + std::to_string(s.pixels_after_consistency) +
           " pixels; try --fusion-min-confidence 0";
  }
  return "the free-space filter removed all " + std::to_string(s.points_fused) +
         " points; try --free-space-max-contradiction 10 or --no-free-space-enabled";
}

}  // namespace pmsp::tool
