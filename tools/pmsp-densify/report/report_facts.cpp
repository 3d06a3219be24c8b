// SPDX-License-Identifier: BSD-2-Clause
#include "report_facts.h"

#include <algorithm>
#include <cstdio>

#include "progress.h"

namespace pmsp::tool {
namespace {

using Json = nlohmann::ordered_json;

/// Number at a path of keys; 0 = missing.
double number_at(const Json& json, const std::vector<const char*>& path) {
  const Json* at = &json;
  for (const char* key : path) {
    if (!at->is_object() || !at->contains(key)) return 0.0;
    at = &at->at(key);
  }
  return at->is_number() ? at->get<double>() : 0.0;
}

std::string text_at(const Json& json, const char* key) {
  return json.is_object() && json.contains(key) && json.at(key).is_string() ? json.at(key).get<std::string>() : "";
}

std::string count_at(const Json& json, const std::vector<const char*>& path) {
  return count_text(static_cast<std::int64_t>(std::clamp(number_at(json, path), 0.0, 1e15)));
}

std::string percent(double part, double whole) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.0f %%", whole > 0.0 ? 100.0 * part / whole : 0.0);
  return text;
}

}  // namespace

Json report_facts(const Json& stats) {
  Json facts = Json::array();
  const auto add = [&facts](const char* name, const std::string& value) {
    if (!value.empty()) facts.push_back({name, value});
  };
  add("Map", text_at(stats, "map"));
  add("Images", text_at(stats, "images"));
  if (stats.contains("outputs") && stats.at("outputs").is_array()) {
    std::string outputs;
    for (const Json& it : stats.at("outputs")) {
      if (it.is_string()) outputs += (outputs.empty() ? "" : ", ") + it.get<std::string>();
    }
    add("Written to", outputs);
  }
  if (number_at(stats, {"keyframes", "in_map"}) > 0.0) {
    add("Keyframes", count_at(stats, {"keyframes", "in_map"}) + " in the map, " +
                         count_at(stats, {"keyframes", "with_image"}) + " with an image, " +
                         count_at(stats, {"keyframes", "depth_maps"}) + " with a depth map");
  }
  add("Points", count_at(stats, {"points_written"}));
  if (stats.contains("cloud")) add("Lengths", text_at(stats.at("cloud"), "lengths"));
  if (number_at(stats, {"options", "width"}) > 0.0) {
    add("Depth maps",
        count_at(stats, {"options", "width"}) + " × " + count_at(stats, {"options", "height"}) + " pixels");
  }
  if (const double pixels = number_at(stats, {"pixels", "unmasked"}); pixels > 0.0) {
    add("Pixels kept", "PatchMatch " + percent(number_at(stats, {"pixels", "matched"}), pixels) + ", median filter " +
                           percent(number_at(stats, {"pixels", "after_median"}), pixels) + ", consistency filter " +
                           percent(number_at(stats, {"pixels", "after_consistency"}), pixels));
  }
  std::string backend = text_at(stats, "backend");
  if (!backend.empty()) {
    backend += ", " + text_at(stats, "simd") + ", " + count_at(stats, {"threads"}) + " threads on the CPU";
  }
  add("Backend", backend);
  if (stats.contains("seed") && stats.at("seed").is_number()) add("Seed", stats.at("seed").dump());
  if (const double seconds = number_at(stats, {"seconds", "total"}); seconds > 0.0) add("Time", duration_text(seconds));
  if (number_at(stats, {"peak_memory_mib"}) > 0.0) add("Memory", count_at(stats, {"peak_memory_mib"}) + " MiB");
  add("Program", text_at(stats, "generator"));
  return facts;
}

Json report_times(const Json& stats) {
  Json times = Json::array();
  const auto add = [&](const char* name, const char* group, const char* key) {
    const double seconds = number_at(stats, {group, key});
    if (seconds > 0.0) times.push_back({name, seconds});
  };
  add("Reading the map", "critical_path", "map");
  add("Finding images", "critical_path", "images");
  add("Waiting for images", "critical_path", "wait_for_images");
  add("Preparing images", "seconds", "prepare");
  add("Initialising", "seconds", "init");
  add("PatchMatch", "seconds", "patchmatch");
  add("Median filter", "seconds", "median");
  add("Consistency filter", "seconds", "consistency");
  add("Fusion", "seconds", "fusion");
  add("Free space", "seconds", "free_space");
  add("Ownership", "seconds", "ownership");
  add("Writing points", "critical_path", "points");
  add("Writing depth maps", "critical_path", "depth_maps");
  add("Writing and reading the workspace", "critical_path", "workspace");
  add("Drawing", "critical_path", "preview");
  add("Waiting for the disk", "critical_path", "finish");
  return times;
}

std::vector<std::string> report_problems(const Json& stats) {
  std::vector<std::string> problems;
  const double unmasked = number_at(stats, {"pixels", "unmasked"});
  const double all = number_at(stats, {"options", "width"}) * number_at(stats, {"options", "height"}) *
                     number_at(stats, {"keyframes", "depth_maps"});
  const bool is_whole = !stats.contains("workspace");  // otherwise pixel counts are those of the last run only
  if (is_whole && all > 0.0 && unmasked > 0.0 && unmasked < 0.995 * all) {
    problems.push_back(percent(all - unmasked, all) + " of the views lie in the mask.");
  }
  if (is_whole && unmasked > 0.0 && number_at(stats, {"pixels", "after_consistency"}) < 0.4 * unmasked) {
    problems.push_back("Only " + percent(number_at(stats, {"pixels", "after_consistency"}), unmasked) +
                       " of the pixels have a depth that other keyframes agree with.");
  }
  if (stats.contains("warnings") && stats.at("warnings").is_array()) {
    for (const Json& warning : stats.at("warnings")) {
      if (warning.is_string()) problems.push_back(warning.get<std::string>());
    }
  }
  return problems;
}

std::string list_of_keyframes(const std::vector<std::int64_t>& ids, const std::vector<std::int64_t>& order) {
  std::vector<std::string> runs;
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;
    while (end < order.size() && std::find(ids.begin(), ids.end(), order[end]) != ids.end()) ++end;
    if (end == i) {
      ++i;
      continue;
    }
    const std::string first = std::to_string(order[i]);
    const std::string last = std::to_string(order[end - 1]);
    if (end == i + 1) {
      runs.push_back(first);
    } else {
      runs.push_back(first + (end == i + 2 ? " and " : " to ") + last);
    }
    i = end;
  }
  std::string text;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (i == 8 && runs.size() > 9) return text + " and " + std::to_string(runs.size() - 8) + " more groups";
    text += (i == 0 ? "" : i + 1 == runs.size() ? " and " : ", ") + runs[i];
  }
  return text;
}

}  // namespace pmsp::tool
