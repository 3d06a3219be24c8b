// SPDX-License-Identifier: BSD-2-Clause
#include "core/small_missions.h"

#include "plan/halo.h"
#include "planned_densifier.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>
#include <utility>

namespace pmsp::test {
namespace {

constexpr int kWidth = 32;
constexpr int kImageWidth = 2 * kWidth;  // images are matched at their own size
constexpr std::size_t kPlaces = 10;

const synth::Mission& room() {
  static const synth::Mission kRoom = synth::empty_room(small_recipe(kImageWidth, static_cast<int>(kPlaces)));
  return kRoom;
}

const Image<std::uint8_t>& mask() {
  static const Image<std::uint8_t> kMask = [] {
    Image<std::uint8_t> result(kImageWidth, kImageWidth / 2, 255);
    for (int y = kImageWidth / 4; y < kImageWidth / 2; ++y) {
      std::fill(result.row(y), result.row(y) + kImageWidth / 4, 0);
    }
    return result;
  }();
  return kMask;
}

template <class Result>
std::string first_difference(const char* what, const std::map<std::int64_t, Result>& a,
                             const std::map<std::int64_t, Result>& b) {
  for (const auto& [id, result] : a) {
    const auto other = b.find(id);
    if (other == b.end()) return std::string(what) + " " + std::to_string(id) + " is missing";
    if (!same(result, other->second)) return std::string(what) + " " + std::to_string(id);
  }
  return a.size() == b.size() ? std::string() : std::string("more of ") + what;
}

void to_world(DepthMap& map) {
  for (float& depth : map.depth.pixels()) depth *= static_cast<float>(map.scale);
  map.scale = 1.0;
}

void to_world(KeyframeCloud& cloud) {
  for (CloudPoint& point : cloud.points) point.position *= static_cast<float>(cloud.scale);
  cloud.scale = 1.0;
}

}  // namespace

std::vector<Keyframe> small_flight(std::size_t count) {
  std::vector<Keyframe> keyframes;
  std::int64_t id = -20;
  std::size_t place = 0;
  constexpr std::size_t kDuplicates = 2 * (kPlaces - 1);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = place % kDuplicates;
    keyframes.push_back(synth::keyframe_of(room(), at < kPlaces ? at : kDuplicates - at));
    keyframes.back().id = id;
    if (i == count / 2) keyframes.back().landmarks.clear();
    if (i % 3 == 1) keyframes.back().mask = mask().view();
    id += i % 7 == 3 ? 2 : 1;
    if (i % 6 != 4) ++place;
  }
  return keyframes;
}

DensifierOptions small_preset(Quality quality, std::uint64_t seed) {
  DensifierOptions options = preset(quality);
  options.width = kWidth;
  options.height = kWidth / 2;
  options.threads = 1;
  options.simd = kAnySimd;
  options.seed = seed;
  options.advanced.patchmatch.refinements = 1;
  options.advanced.fusion.history = 4;
  options.advanced.free_space.history = 8;
  options.advanced.free_space.views = 3;
  options.advanced.init.chain_keyframes = 4;
  return options;
}

std::vector<SmallMission> small_missions(std::uint64_t seed) {
  const std::size_t count = kSanitized ? 12 : 28;
  std::vector<SmallMission> missions;
  for (const Quality quality : {Quality::kOnline, Quality::kNormal, Quality::kHigh}) {
    const char* const name = quality == Quality::kOnline ? "online" : quality == Quality::kNormal ? "normal" : "high";
    if (kSanitized && quality != Quality::kNormal) continue;  // the other presets have no further stages
    missions.push_back({name, small_preset(quality, seed), small_flight(count)});
  }
  SmallMission photos{"photos", small_preset(Quality::kOnline, seed), small_flight(count / 2)};
  photos.options.unordered = true;
  std::reverse(photos.keyframes.begin(), photos.keyframes.begin() + static_cast<std::ptrdiff_t>(count / 3));
  missions.push_back(std::move(photos));
  SmallMission all_used{"all used", small_preset(Quality::kOnline, seed), small_flight(count / 2)};
  all_used.options.advanced.view_filter.enabled = false;  // the keyframe without landmarks then lends its image
  all_used.options.advanced.patchmatch.geometric_passes = 0;
  all_used.options.advanced.consistency.enabled = false;
  all_used.options.advanced.fusion.window = 1;
  missions.push_back(std::move(all_used));
  return missions;
}

Plan plan_of(const SmallMission& mission) {
  std::vector<PlanKeyframe> records;
  for (const Keyframe& keyframe : mission.keyframes) records.push_back(plan_keyframe(keyframe, mission.options));
  return make_plan(records, mission.options);
}

std::vector<std::int64_t> ids_of(const std::vector<Keyframe>& keyframes) {
  std::vector<std::int64_t> ids;
  for (const Keyframe& keyframe : keyframes) ids.push_back(keyframe.id);
  return ids;
}

Keyframe keyframe_of(const SmallMission& mission, std::int64_t id) {
  return *std::find_if(mission.keyframes.begin(), mission.keyframes.end(),
                       [&](const Keyframe& keyframe) { return keyframe.id == id; });
}

void give_scales(SmallMission& mission) {
  for (std::size_t i = 0; i < mission.keyframes.size(); ++i) {
    mission.keyframes[i].scale = std::ldexp(1.0, static_cast<int>(i % 5) - 2);
  }
}

ResultsById in_scene_units(ResultsById results) {
  for (auto& [id, map] : results.raw) to_world(map);
  for (auto& [id, map] : results.filtered) to_world(map);
  for (auto& [id, cloud] : results.clouds) to_world(cloud);
  return results;
}

void fly_through(Densifier& densifier, const SmallMission& mission) {
  for (const Keyframe& keyframe : mission.keyframes) densifier.add(keyframe);
  densifier.flush();
}

ResultsById by_id(const Recording& recording) {
  ResultsById results;
  results.add(recording);
  return results;
}

void ResultsById::add(const Recording& recording) {
  for (const DepthMap& map : recording.raw) repeated += raw.emplace(map.keyframe_id, map).second ? 0 : 1;
  for (const DepthMap& map : recording.filtered) repeated += filtered.emplace(map.keyframe_id, map).second ? 0 : 1;
  for (const KeyframeCloud& cloud : recording.clouds) {
    repeated += clouds.emplace(cloud.keyframe_id, cloud).second ? 0 : 1;
  }
}

std::size_t ResultsById::points() const {
  std::size_t sum = 0;
  for (const auto& [id, cloud] : clouds) sum += cloud.points.size();
  return sum;
}

std::string difference(const ResultsById& a, const ResultsById& b) {
  if (a.repeated + b.repeated > 0) return "a result came twice";
  std::string found = first_difference("raw depth map", a.raw, b.raw);
  if (found.empty()) found = first_difference("filtered depth map", a.filtered, b.filtered);
  if (found.empty()) found = first_difference("cloud", a.clouds, b.clouds);
  return found;
}

Recording whole_run(const SmallMission& mission) {
  Recording recording;
  Densifier densifier(mission.options, recording.callbacks());
  fly_through(densifier, mission);
  return recording;
}

Recording run_part(const SmallMission& mission, const Plan& plan, const std::vector<std::int64_t>& ids,
                   std::size_t* images) {
  const Halo needed = find_halo(plan, ids, mission.options, Wanted::kPoints);
  const std::unordered_set<std::int64_t> given(needed.images.begin(), needed.images.end());
  Recording recording;
  PlannedDensifier densifier(mission.options, plan, ids, recording.callbacks());
  for (const Keyframe& keyframe : mission.keyframes) {
    if (given.count(keyframe.id) != 0) densifier.add(keyframe);
  }
  densifier.flush();
  if (images != nullptr) *images += given.size();
  return recording;
}

}  // namespace pmsp::test
