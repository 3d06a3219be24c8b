// SPDX-License-Identifier: BSD-2-Clause
#include "plan/plan.h"

#include <unordered_set>

#include "plan/planner.h"
#include "pmsp/error.h"
#include "view_filter/sharpness.h"

namespace pmsp {
namespace {

constexpr KeyframeUse kUses[] = {
    KeyframeUse::kDepthMap,        KeyframeUse::kNoNeighbour, KeyframeUse::kNoRange, KeyframeUse::kTooLittleParallax,
    KeyframeUse::kTooMuchParallax, KeyframeUse::kNoLandmarks, KeyframeUse::kBlurred};

}  // namespace

const char* name_of(KeyframeUse use) {
  switch (use) {
    case KeyframeUse::kDepthMap:
      return "depth map";
    case KeyframeUse::kNoNeighbour:
      return "no neighbour";
    case KeyframeUse::kNoRange:
      return "no range";
    case KeyframeUse::kTooLittleParallax:
      return "too little parallax";
    case KeyframeUse::kTooMuchParallax:
      return "too much parallax";
    case KeyframeUse::kNoLandmarks:
      return "no landmarks";
    case KeyframeUse::kBlurred:
      break;
  }
  return "blurred";
}

KeyframeUse keyframe_use_from_name(const std::string& name) {
  std::string names;
  for (const KeyframeUse use : kUses) {
    if (name == name_of(use)) return use;
    names += (names.empty() ? "" : ", ") + std::string(name_of(use));
  }
  throw InvalidInput("the use of a keyframe is '" + name.substr(0, 100) + "'; expected one of " + names);
}

SharpnessRecord record_sharpness(const Keyframe& keyframe, int width, const Executor* executor) {
  if (keyframe.image.empty()) return {};
  return {landmark_sharpness(keyframe, width > 0 ? width : keyframe.image.width, executor)};
}

PlanKeyframe plan_keyframe(const Keyframe& keyframe, const DensifierOptions& options, const Executor* executor) {
  PlanKeyframe result{keyframe.id, keyframe.cam_from_world, keyframe.landmarks, {}};
  if (options.advanced.view_filter.enabled && options.advanced.view_filter.min_sharpness > 0.0) {
    result.sharpness = record_sharpness(keyframe, options.width > 0 ? options.width : 2 * options.height, executor);
  }
  return result;
}

Plan make_plan(const std::vector<PlanKeyframe>& keyframes, const DensifierOptions& options, const Plan* previous) {
  std::unordered_set<std::int64_t> ids;
  for (const PlanKeyframe& keyframe : keyframes) {
    if (!ids.insert(keyframe.id).second) {
      throw InvalidInput("keyframe " + std::to_string(keyframe.id) + " appears more than once; expected unique ids");
    }
  }
  Planner planner(options, previous);
  for (const PlanKeyframe& keyframe : keyframes) planner.add(keyframe);
  planner.finish();
  return {{planner.entries().begin(), planner.entries().end()}};
}

}  // namespace pmsp
