// SPDX-License-Identifier: BSD-2-Clause
#include "mission_input.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <nlohmann/json.hpp>

#include "exit_code.h"
#include "numbers.h"

namespace pmsp::tool {

namespace fs = std::filesystem;

namespace {

bool has_images(const Arguments& arguments) { return !arguments.images.empty() || !arguments.video.empty(); }

}  // namespace

SlamMap read_map(const Arguments& arguments) {
  return pmsp::read_map(arguments.map,
                        {arguments.component, arguments.points, arguments.image_list, arguments.camera_from_body});
}

Arguments with_images(const Arguments& arguments, const SlamMap& map) {
  Arguments result = arguments;
  std::error_code ignored;
  if (has_images(arguments)) return result;
  if (fs::is_directory(map.images, ignored)) result.images = map.images;
  if (fs::is_regular_file(map.images, ignored)) result.video = map.images;
  return result;
}

Arguments with_needed_images(const Arguments& arguments) {
  if (has_images(arguments)) return arguments;
  const SlamMap map = read_map(arguments);
  if (map.images.empty()) throw UsageError("the images are missing; give --images DIR or --video FILE");
  Arguments result = with_images(arguments, map);
  if (!has_images(result)) result.images = map.images;  // reported as missing
  return result;
}

std::vector<const MapKeyframe*> in_time_order(const SlamMap& map) {
  std::vector<const MapKeyframe*> keyframes;
  for (const MapKeyframe& keyframe : map.keyframes) keyframes.push_back(&keyframe);
  std::stable_sort(keyframes.begin(), keyframes.end(),
                   [](const MapKeyframe* a, const MapKeyframe* b) { return a->timestamp < b->timestamp; });
  return keyframes;
}

MaskOptions mask_options(const Arguments& arguments, const SlamMap& map, const ImageSource& source) {
  MaskOptions options{arguments.mask, arguments.images, arguments.mask_nadir, arguments.mask_zenith,
                      !arguments.no_masks};
  io::name_masks(map, source, options);
  return options;
}

std::string masks_text(const Arguments& arguments, workspace::Workspace& workspace) {
  std::error_code ignored;
  std::string text;
  if (fs::is_directory(arguments.mask, ignored)) {
    text = "one for each image";
  } else if (!arguments.mask.empty()) {
    text = workspace.fingerprint(arguments.mask);
  }
  if (arguments.mask_nadir > 0.0) text += ", nadir " + nlohmann::json(arguments.mask_nadir).dump();
  if (arguments.mask_zenith > 0.0) text += ", zenith " + nlohmann::json(arguments.mask_zenith).dump();
  return text;
}

std::unique_ptr<ImageSource> open_images(const Arguments& arguments, const SlamMap& map) {
  const bool allow_missing = arguments.allow_missing || arguments.growing || arguments.follow;  // more will follow
  if (!arguments.images.empty()) {
    ImageFolderOptions options;
    options.fps = arguments.fps;
    options.frame_offset = arguments.frame_offset;
    options.allow_missing = allow_missing;
    return open_image_folder(map, arguments.images, options);
  }
  if (arguments.video.empty()) return nullptr;
  VideoOptions options;
  options.fps = arguments.fps;
  options.frame_offset = arguments.frame_offset;
  options.presentation_times = arguments.presentation_times;
  options.allow_missing = allow_missing;
  return open_video(map, arguments.video, options);
}

namespace {

constexpr double kHidesMost = 0.6;  ///< share of the sphere that causes a warning

bool has_files(const MaskSummary& it) { return !it.first.empty(); }

/// Returns "mask.png and a cap of 20 degrees at the nadir".
std::string sources(const Arguments& arguments, const SlamMap& map, const MaskSummary& it) {
  std::vector<std::string> all;
  const auto some = [&it](std::size_t count) {
    return std::to_string(count) + " of " + std::to_string(it.images) + " images have one ";
  };
  if (it.in_folder > 0) {
    std::string text = some(it.in_folder) + "in " + arguments.mask.string();
    if (!it.unmatched.empty()) {
      text += " (files there of no image: " + std::to_string(it.unmatched.size()) + ", such as " +
              it.unmatched.front().filename().string() + ")";
    }
    all.push_back(text);
  } else if (!arguments.mask.empty()) {
    all.push_back(arguments.mask.string() + (it.by_alpha ? " (its alpha channel)" : ""));
  }
  if (it.named > 0) all.push_back(some(it.named) + "that " + map.path.filename().string() + " names");
  if (it.in_masks > 0) {
    all.push_back(some(it.in_masks) + "in the directory masks beside them" +
                  (it.named == 0 ? ", such as " + it.first.string() : ""));
  }
  if (it.beside > 0)
    all.push_back(some(it.beside) + "beside them, by a name such as 7_mask.png or 7.mask.png for 7.jpg");
  if (it.with_alpha > 0) all.emplace_back("alpha channels of images");
  for (const auto& [degrees, place] : {std::pair(arguments.mask_nadir, "nadir"), {arguments.mask_zenith, "zenith"}}) {
    if (degrees > 0.0) all.push_back("a cap of " + number_text(degrees) + " degrees at the " + place);
  }
  std::string text;
  for (const std::string& source : all) text += (text.empty() ? "" : " and ") + source;
  return text;
}

std::string hidden_text(const MaskSummary& it) {
  constexpr double kSame = 0.0005;
  std::string text = percent_text(it.hidden) + " of the sphere is hidden";
  if (it.most - it.least > kSame)
    text += " on average (" + percent_text(it.least) + " to " + percent_text(it.most) + ")";
  return text;
}

void warn_of_share(const SlamMap& map, const MaskSummary& it, std::vector<std::string>& warnings) {
  const bool may_be_inverted = has_files(it) && !(it.named > 0 && map.masks_are_instances);
  if (may_be_inverted && it.hidden_by_files == 0.0) {
    std::string text =
        "the mask " + it.first.string() + " hides nothing: black (0) is ignored, any other colour is used";
    if (!it.colours.empty()) text += ", and it is " + it.colours + "; paint ignored parts black";
    warnings.push_back(text);
  }
  if (it.hidden <= kHidesMost) return;
  const std::string much = "masks hide " + percent_text(it.hidden) + " of the sphere";
  if (may_be_inverted && it.hidden_by_files > kHidesMost) {
    const bool by_alpha = it.by_alpha;
    warnings.push_back(much + ": " + (by_alpha ? "transparent" : "black (0)") + " is ignored, " +
                       (by_alpha ? "opaque" : "white (any other colour)") + " is used; if " + it.first.string() +
                       " is inverted, invert it back");
  } else if (it.with_alpha > 0) {
    warnings.push_back(much + ": transparent pixels of images are ignored; --no-masks uses them");
  } else {
    warnings.push_back(much + ", which leaves little to densify");
  }
}

/// Warns of files that look like masks but are unused.
void warn_of_unused(const Arguments& arguments, const SlamMap& map, const MaskSummary& it,
                    std::vector<std::string>& warnings) {
  if (arguments.no_masks || !arguments.mask.empty() || arguments.images.empty()) return;
  if (it.named_missing > 0) {
    warnings.push_back("missing masks that " + map.path.filename().string() +
                       " names: " + std::to_string(it.named_missing) + ", such as " + it.first_missing.string() +
                       "; their images are used without masks; add them, or give their directory with --mask");
  }
  std::error_code error;
  const fs::path images = fs::absolute(arguments.images, error).lexically_normal();
  const fs::path folder = (images.has_filename() ? images : images.parent_path()).parent_path() / "masks";
  if (it.named + it.in_masks > 0 || !fs::is_directory(folder, error) || fs::is_empty(folder, error)) return;
  warnings.push_back("the masks in " + folder.string() +
                     " are not used: none has the name of an image; expected 7.jpg.png, 7.png or 7_mask.png for 7.jpg");
}

/// Evaluates the masks of all images, or of an evenly spread sample. Throws as MaskSource::look.
MaskReport look_at_masks(const Arguments& arguments, const SlamMap& map, const ImageSource& source, MaskSource& masks) {
  std::vector<fs::path> images;
  for (const std::int64_t id : source.keyframe_ids()) images.push_back(source.origin(id).name());
  MaskReport report;
  if (images.empty()) return report;
  const MapKeyframe* first = map.find_keyframe(source.keyframe_ids().front());
  const MapCamera& camera = map.cameras[static_cast<std::size_t>(first != nullptr ? first->camera : 0)];
  constexpr int kEnough = 2048;  // width [columns]
  int width = camera.width, height = camera.height;
  for (; width > kEnough && width % 2 == 0 && height % 2 == 0; height /= 2) width /= 2;
  const MaskSummary it = masks.summarise(images, width, height);
  warn_of_unused(arguments, map, it, report.warnings);
  const bool any = has_files(it) || it.with_alpha > 0 || arguments.mask_nadir > 0.0 || arguments.mask_zenith > 0.0;
  if (!any) return report;
  warn_of_share(map, it, report.warnings);
  report.text = sources(arguments, map, it) + "; " + hidden_text(it);
  if (it.named + it.in_masks + it.beside + it.with_alpha > 0)
    report.text += "; --no-masks ignores masks that come with images";
  const bool is_each = it.in_folder + it.named + it.in_masks + it.beside > 0;
  report.json = {{"hidden", it.hidden},
                 {"min", it.least},
                 {"max", it.most},
                 {"weighted_by", "solid angle"},
                 {"images", it.images},
                 {"with_file", is_each         ? it.in_folder + it.named + it.in_masks + it.beside
                               : has_files(it) ? it.images
                                               : 0},
                 {"with_alpha", it.with_alpha},
                 {"looked_at", it.looked_at},
                 {"file", it.first.string()},
                 {"nadir", arguments.mask_nadir},
                 {"zenith", arguments.mask_zenith}};
  return report;
}

/// Returns sentences about the map for people: components, dropped parts, assumptions.
std::vector<std::string> remarks(const SlamMap& map) {
  std::vector<std::string> all = map.notes;
  if (map.component_keyframes.size() > 1) {
    std::string text = "component " + std::to_string(map.component) + " of " +
                       std::to_string(map.component_keyframes.size()) + "; keyframes of each:";
    for (const std::size_t count : map.component_keyframes) text += " " + std::to_string(count);
    all.insert(all.begin(), text + "; --component N selects one");
  }
  if (!map.observations_are_measured && !map.landmarks.empty()) {
    all.push_back(
        "observations of points are unknown; points are assigned to the keyframes in which no nearer point hides them");
  }
  const bool has_times =
      std::any_of(map.keyframes.begin(), map.keyframes.end(), [](const MapKeyframe& k) { return k.timestamp != 0.0; });
  if (!has_times && map.keyframes.size() > 1) {
    all.push_back("keyframes have no timestamps; they are in the order of their ids, or a set with --unordered");
  }
  return all;
}

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
  const ScopedTimer spent(time_, Activity::kMap);
  set_map(tool::read_map(arguments_));
  remarks = tool::remarks(map);
}

void MissionInput::open_images() {
  const ScopedTimer spent(time_, Activity::kImages);
  opened_images_ = tool::open_images(arguments_, map);
  opened_masks_.reset(new MaskSource(mask_options(arguments_, map, *opened_images_)));
  set_images(*opened_images_, *opened_masks_);
  mask_report = look_at_masks(arguments_, map, *images, *masks);
  for (const std::string& warning : mask_report.warnings) progress_.warning(warning);
}

void MissionInput::check_poses() {
  const ScopedTimer spent(time_, Activity::kImages);
  Mission::check_poses();
  if (!map.landmarks.empty()) return;
  progress_.warning(
      "neither the map nor the images give landmarks, so that no keyframe has a depth range or a depth map; "
      "give a PLY file with points of the same frame (--points)");
}

void MissionInput::open_prior_depths() {
  prior_depths = io::PriorDepths(arguments_.prior_depth, arguments_.images, map);
}

CloudFrame find_frame(const Arguments& arguments, const SlamMap& map, const ImageSource& images) {
  ImageFiles files;
  if (!arguments.cloud.frame.align.empty()) {
    for (const std::int64_t id : images.keyframe_ids()) files[id] = images.origin(id).file;
  }
  return find_cloud_frame(arguments.cloud.frame, map, files);
}

CloudFrame MissionInput::find_frame() const { return tool::find_frame(arguments_, map, *images); }

void MissionInput::announce() const {
  progress_.message(map.path.string() + " (" + map.format + "): " + std::to_string(map.keyframes.size()) +
                    " keyframes, " + std::to_string(map.landmarks.size()) + " landmarks");
  for (const std::string& remark : remarks) progress_.message(remark);
  progress_.message("images: " + images->description());
  if (!mask_report.text.empty()) progress_.message("masks: " + mask_report.text);
  for (const SkippedKeyframe& skipped : images->skipped()) progress_.skipped(skipped);
}

}  // namespace pmsp::tool
