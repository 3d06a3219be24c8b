// SPDX-License-Identifier: BSD-2-Clause
#include "mission_input.h"

#include "image_input.h"
#include "map_input.h"

namespace pmsp::tool {
namespace {

using ScopedTimer = TimeAccount::Scope;

/// When merging, the shards have checked the conventions.
io::MissionOptions mission_options(const Arguments& arguments, int threads) {
  return {!arguments.no_verify && arguments.verb != Verb::kMerge, !arguments.no_verify, threads};
}

}  // namespace

MissionInput::MissionInput(const Arguments& arguments, Progress& progress, int threads, TimeAccount* time)
    : Mission(mission_options(arguments, threads), {[&progress](const std::string& text) { progress.stage(text); },
                                                    [&progress](const std::string& text) { progress.warning(text); }}),
      arguments_(arguments),
      progress_(progress),
      time_(time) {}

void MissionInput::read_map() {
  progress_.stage("reading " + arguments_.map.string());
  const ScopedTimer spent(time_, Busy::kMap);
  set_map(tool::read_map(arguments_));
  remarks = tool::remarks(map);
}

void MissionInput::open_images() {
  const ScopedTimer spent(time_, Busy::kImages);
  opened_images_ = tool::open_images(arguments_, map);
  opened_masks_.reset(new MaskSource(mask_options(arguments_, map, *opened_images_)));
  set_images(*opened_images_, *opened_masks_);
  mask_report = look_at_masks(arguments_, map, *images, *masks);
  for (const std::string& warning : mask_report.warnings) progress_.warning(warning);
}

void MissionInput::check_poses() {
  const ScopedTimer spent(time_, Busy::kImages);
  Mission::check_poses();
  if (!map.landmarks.empty()) return;
  progress_.warning(
      "neither the map nor the images give landmarks, so that no keyframe has a depth range or a depth map; "
      "give a PLY file with points of the same frame (--points)");
}

void MissionInput::open_prior_depths() { prior_depths = io::PriorDepths(arguments_.prior_depth, arguments_.images); }

CloudFrame MissionInput::find_frame() const {
  ImageFiles files;
  if (!arguments_.cloud.frame.align.empty()) {
    for (const std::int64_t id : images->keyframe_ids()) files[id] = images->origin(id).file;
  }
  return find_cloud_frame(arguments_.cloud.frame, map, files);
}

void MissionInput::announce() const {
  progress_.message(map.path.string() + " (" + map.format + "): " + std::to_string(map.keyframes.size()) +
                    " keyframes, " + std::to_string(map.landmarks.size()) + " landmarks");
  for (const std::string& remark : remarks) progress_.message(remark);
  progress_.message("images: " + images->description());
  if (!mask_report.text.empty()) progress_.message("masks: " + mask_report.text);
  for (const SkippedKeyframe& skipped : images->skipped()) progress_.skipped(skipped);
}

}  // namespace pmsp::tool
