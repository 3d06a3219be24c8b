// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/loss.h"

#include <algorithm>
#include <vector>

#include <nlohmann/json.hpp>

namespace pmsp::workspace {
namespace {

using Json = nlohmann::ordered_json;

/// Adds "patchmatch.iterations 3 -> 4" for each option with different values.
void add_differences(const Json& then, const Json& now, const std::string& prefix, std::vector<std::string>& texts) {
  for (const auto& [key, value] : now.items()) {
    if (!then.contains(key) || then[key] == value) continue;
    if (value.is_object()) {
      add_differences(then[key], value, prefix + key + ".", texts);
    } else {
      texts.push_back(prefix + key + " " + then[key].dump() + " -> " + value.dump());
    }
  }
}

/// Returns "" if only lens distance and rig mask differ, which are estimated again as a mission grows.
std::string difference(const Record& record, const StepInputs& inputs) {
  constexpr std::size_t kMost = 4;
  const char* const kLenses = "lens_distance";
  const Json then = Json::parse(record.options);
  Json now = Json::parse(inputs.planes_options_json);
  const bool has_other_lenses = now.value(kLenses, Json()) != then.value(kLenses, Json());
  const bool has_new_rig = now.contains(kRigMask) && !then.contains(kRigMask);
  for (const char* key : {kLenses, kRigMask}) now.erase(key);
  std::vector<std::string> texts;
  add_differences(then, now, "", texts);
  if (record.engine != inputs.engine) texts.push_back("engine \"" + record.engine + "\" -> \"" + inputs.engine + "\"");
  if (texts.empty() && !has_other_lenses && !has_new_rig)
    texts.emplace_back("another mask, or other depth images of --prior-depth");
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, texts.size()); ++i) text += (i > 0 ? ", " : "") + texts[i];
  if (texts.size() > kMost) text += " and " + std::to_string(texts.size() - kMost) + " more";
  return text;
}

bool is_small_part(std::size_t part, std::size_t whole) { return 10 * part < whole; }

}  // namespace

std::string image_alone(const std::string& image) {
  return image.substr(0, std::min(image.find(", mask "), image.find(", prior depth ")));
}

Loss loss_of(const Record& record, const StepInputs& inputs, const std::map<std::int64_t, std::string>& images) {
  Loss loss;
  loss.keyframes = record.keyframes.size();
  for (const auto& [id, keyframe] : record.keyframes) {
    loss.planes += keyframe.planes ? 1 : 0;
    const auto now = images.find(id);
    if (now == images.end() || image_alone(now->second) != image_alone(keyframe.image)) continue;
    ++loss.same;
    if (!keyframe.planes) continue;
    ++loss.comparable;
    loss.kept += keyframe.planes->own == planes_inputs(inputs, now->second) ? 1 : 0;
  }
  if (loss.planes == 0 || images.empty()) return loss;
  loss.is_other_mission = is_small_part(loss.same, std::min(loss.keyframes, images.size()));
  if (loss.is_other_mission || !is_small_part(loss.kept, loss.comparable)) return loss;
  loss.difference = difference(record, inputs);
  loss.is_nearly_all = !loss.difference.empty();
  return loss;
}

}  // namespace pmsp::workspace
