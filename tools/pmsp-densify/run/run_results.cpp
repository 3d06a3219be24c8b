// SPDX-License-Identifier: BSD-2-Clause
#include "run_results.h"

#include <future>
#include <optional>
#include <string>

#include "cloud_arguments.h"
#include "estimates.h"
#include "export/robot_map.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp::tool {
namespace {

/// Throws InvalidInput if maps for robots are expected to exceed their memory by far; returns a warning if they may;
/// "" = none.
std::string check_map_size(const SlamMap& map, const CloudHeader& header, const std::optional<Box>& box) {
  if (!(header.cell_size > 0.0)) return "";  // reported by the writer
  constexpr double kCertain = 2.0, kLikely = 0.5;
  const double expected = expected_map_bytes(map, header, box), most = kMostMapBytes;
  const std::string text = "cells of " + number_text(header.cell_size) + " make a map for robots that needs about " +
                           bytes_text(expected) + " of memory, ";
  if (expected > kCertain * most) {
    throw InvalidInput(text + "at most " + bytes_text(most) + " are allowed; give a larger --cell-size, or --crop");
  }
  if (expected < kLikely * most) return "";
  return text + "more than " + bytes_text(most) +
         " are an error at the end of the run; give a larger --cell-size, or --crop";
}

}  // namespace

RunResults::RunResults(const Setup& setup, TimeAccount& time)
    : arguments_(setup.arguments), time_(time), live_(setup.live) {
  CloudHeader header = cloud_header(arguments_, setup.options, setup.map, setup.frame);
  header.export_views = setup.export_views;
  header.threads = setup.threads;
  if (arguments_.cloud.has_map()) map_warning_ = check_map_size(setup.map, header, arguments_.cloud.amount.crop);
  output_ = std::make_unique<CloudOutput>(header, arguments_.cloud.amount, arguments_.cloud.targets());
  const double lens_distance = setup.options.lens_distance;
  const auto open = [&](std::optional<DepthMapFolder>& folder, const std::filesystem::path& path, const char* kind) {
    if (path.empty()) return;
    const double scale = png_depth_scale(setup.map, setup.options.advanced.init.range_margin);
    folder.emplace(path, setup.map, arguments_.depth_formats,
                   DepthMapFolder::About{kind, scale, lens_distance, setup.cloud});
  };
  open(filtered_, arguments_.depth_maps, "filtered");
  open(raw_, arguments_.raw_depth_maps, "raw");
  if (!arguments_.preview.empty()) preview_.emplace(arguments_.preview, setup.keyframes);
  if (!arguments_.report.path.empty()) {
    page_.emplace(arguments_.report, header, setup.map, setup.keyframes);
    if (!arguments_.workspace.empty()) page_->keep_photos();
    output_->add_writer(page_->cloud());
    if (arguments_.cloud.frame.align == kAlignExif) page_->set_north();
    for (const CloudOutput::Target& target : arguments_.cloud.targets()) {
      if (target.format->name == std::string("potree")) page_->set_potree(target.path);
    }
  }
}

PlannedCallbacks RunResults::callbacks() {
  PlannedCallbacks callbacks;
  if (raw_) {
    callbacks.raw_depth = [this](const DepthMap& map) {
      const ScopedTimer spent(time_, Activity::kDepthMaps);
      raw_->write(map);
    };
  }
  const bool has_dataset_depth = arguments_.cloud.wants_depth();
  if (filtered_ || preview_ || page_ || has_dataset_depth) {
    callbacks.filtered_depth = [this, has_dataset_depth](const DepthMap& map) {
      const ScopedTimer spent(time_, Activity::kDepthMaps);
      if (has_dataset_depth) output_->add_depth(map);
      if (filtered_) filtered_->write(map);
      const ScopedTimer drawing(time_, Activity::kPreview);
      if (preview_) preview_->add_depth(map);
      if (page_) page_->add_depth(map);
    };
  }
  callbacks.cloud = [this](const KeyframeCloud& cloud) {
    const ScopedTimer spent(time_, Activity::kPoints);
    output_->add(cloud);
    for (std::size_t i = 0; i < cloud.points.size(); i += 16, ++sampled_) confidence_sum_ += cloud.points[i].confidence;
    const ScopedTimer drawing(time_, Activity::kPreview);
    if (preview_) preview_->add_points(cloud);
    if (live_ != nullptr) live_->add(cloud);
  };
  if (page_) callbacks.planned = [this](const PlanEntry& entry) { page_->set_use(entry); };
  return callbacks;
}

void RunResults::add_image(std::size_t index, const Keyframe& keyframe, int width, int height) {
  const ScopedTimer spent(time_, Activity::kPreview);
  if (live_ != nullptr) live_->add_photo(keyframe);
  if (preview_) preview_->add_keyframe(index, keyframe.id, keyframe.cam_from_world, keyframe.image, width, height);
  if (page_) page_->add_image(index, keyframe);
}

void RunResults::added(const Keyframe& keyframe, bool accepted) {
  if (live_ != nullptr) live_->set_camera(keyframe.cam_from_world);
  if (preview_ && !accepted) preview_->drop_keyframe(keyframe.id);
  if (page_) page_->set_used(keyframe.id, accepted);
}

void RunResults::finish_depth_maps() {
  if (raw_) raw_->write_index();
  if (filtered_) filtered_->write_index();
}

void RunResults::commit_depth_maps() {
  if (raw_) raw_->commit();
  if (filtered_) filtered_->commit();
}

void RunResults::complete() {
  const ScopedTimer spent(time_, Activity::kPoints);
  output_->complete();
}

void RunResults::write(Progress& progress) {
  std::future<std::string> drawn;  // drawn while pending data are written to disk
  if (preview_) {
    const auto draw = [this, points = output_->points_in()] { return preview_->finish(points); };
    drawn = std::async(std::launch::async, draw);
  }
  progress.stage("writing " + arguments_.cloud.text());
  {
    const ScopedTimer spent(time_, Activity::kFinish);
    try {
      output_->commit();
    } catch (const InvalidInput& error) {  // of a map; the clouds are complete
      map_failure_ = error.what();
    }
  }
  commit_depth_maps();
  if (!preview_) return;
  const ScopedTimer spent(time_, Activity::kPreview);
  progress.stage("drawing " + arguments_.preview.string());
  dropped_ = drawn.get();
  preview_->commit();
}

void RunResults::write_page(Progress& progress, const nlohmann::ordered_json& stats) {
  if (!page_) return;
  const ScopedTimer spent(time_, Activity::kPreview);
  progress.stage("writing " + arguments_.report.path.string());
  page_->write(stats);
  if (live_ != nullptr) live_->set_report(arguments_.report.path, page_->beside());
}

std::string RunResults::text() const {
  std::string text = arguments_.cloud.text();
  const auto add = [&text](const char* what, const std::filesystem::path& path) {
    if (!path.empty()) text += std::string(", ") + what + " " + path.string();
  };
  add("report", arguments_.report.path);
  add("pictures", arguments_.preview);
  add("depth maps", arguments_.depth_maps);
  add("raw depth maps", arguments_.raw_depth_maps);
  add("statistics", arguments_.stats);
  return text;
}

}  // namespace pmsp::tool
