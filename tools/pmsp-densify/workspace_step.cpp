// SPDX-License-Identifier: BSD-2-Clause
#include "workspace_step.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "densifier_checks.h"
#include "io/map_keyframe.h"
#include "option_table.h"
#include "pmsp/error.h"
#include "targets.h"

namespace pmsp::tool {
namespace {

using workspace::StepKeyframePlan;

/// What makes the same bytes has the same text.
std::string engine_text(const DensifierOptions& options, const std::string& backend) {
  const std::string text = version_text() + ", ";
  if (options.backend == Backend::kCuda) return text + backend.substr(backend.find(',') + 2);
  return text + (options.simd == Simd::kScalar ? "CPU, plain code" : "CPU, fused multiply-add");
}

/// Relative to the workspace, so that both may be moved together.
std::string relative_text(const std::filesystem::path& path, const std::filesystem::path& folder) {
  std::error_code error;
  const std::filesystem::path relative = std::filesystem::relative(place_of(path), place_of(folder), error);
  return error || relative.empty() ? place_of(path).string() : relative.string();
}

/// What a file of a keyframe holds, if it is the keyframe's.
template <class T>
T own(std::int64_t id, T loaded) {
  if (loaded.keyframe_id == id) return loaded;
  throw IoError("the record of the workspace names a file of keyframe " + std::to_string(loaded.keyframe_id) +
                " as that of keyframe " + std::to_string(id) + "; delete the workspace, or name another one");
}

/// What the sharpness of an image is recorded for.
std::string looked_for_text(const DensifierOptions& options) {
  const bool looks = options.view_filter.enabled && options.view_filter.min_sharpness > 0.0;
  return looks ? "blur at a width of " + std::to_string(options.width) : "nothing";
}

/// Whether most landmarks of a record are still observed. Where not, it can hardly be compared with newer ones.
bool is_up_to_date(const SharpnessRecord& record, const std::vector<Landmark>& landmarks) {
  std::set<std::int64_t> ids;
  for (const Landmark& landmark : landmarks) ids.insert(landmark.id);
  const auto observed = std::count_if(record.landmarks.begin(), record.landmarks.end(),
                                      [&](const LandmarkSharpness& at) { return ids.count(at.id) != 0; });
  return 2 * static_cast<std::size_t>(observed) >= record.landmarks.size();
}

}  // namespace

WorkspaceStep::WorkspaceStep(workspace::Workspace& workspace, const Arguments& arguments,
                             const DensifierOptions& options, const SlamMap& map, bool growing)
    : workspace_(workspace),
      arguments_(arguments),
      options_(options),
      map_(map),
      executor_(options.threads, options.simd) {
  workspace_.look_again();
  inputs_.options = options;
  if (!arguments.mask.empty()) inputs_.mask = workspace_.fingerprint(arguments.mask);
  inputs_.growing = growing;
  inputs_.ask_all_again = !arguments.depth_maps.empty() || !arguments.preview.empty();
}

std::set<std::int64_t> WorkspaceStep::new_images(const ImageSource& source, std::vector<SkippedKeyframe>& unreadable) {
  std::set<std::int64_t> fresh;
  for (const std::int64_t id : source.keyframe_ids()) {
    const ImageSource::Origin origin = source.origin(id);
    const Keyframe keyframe = io::keyframe_of(map_, *map_.find_keyframe(id));
    workspace::StepKeyframe it;
    it.keyframe = {id, keyframe.cam_from_world, keyframe.landmarks, {}};
    it.looked_for = looked_for_text(options_);
    try {
      it.image = workspace_.fingerprint(origin.file) + (origin.frame.empty() ? "" : ", " + origin.frame);
    } catch (const IoError& error) {
      unreadable.push_back({id, error.what()});
      continue;
    }
    const auto found = workspace_.record().keyframes.find(id);
    const bool is_known = found != workspace_.record().keyframes.end() && found->second.image == it.image &&
                          found->second.looked_for == it.looked_for &&
                          is_up_to_date(found->second.sharpness, keyframe.landmarks);
    if (is_known) {
      it.width = found->second.width;
      it.height = found->second.height;
      it.keyframe.sharpness = found->second.sharpness;
    } else {
      fresh.insert(id);
    }
    ids_.push_back(id);
    stock_[id] = std::move(it);
  }
  return fresh;
}

void WorkspaceStep::look_at(std::int64_t keyframe_id, const Image<Rgb>& image) {
  workspace::StepKeyframe& it = stock_.at(keyframe_id);
  Keyframe keyframe = io::keyframe_of(map_, *map_.find_keyframe(keyframe_id));
  keyframe.image = image.view();
  it.keyframe = plan_keyframe(keyframe, options_, &executor_);
  it.width = image.width();
  it.height = image.height();
}

void WorkspaceStep::decide() {
  for (const std::int64_t id : ids_) {
    if (stock_.at(id).width > 0) inputs_.keyframes.push_back(std::move(stock_.at(id)));
  }
  if (!inputs_.keyframes.empty()) fill_in_size(options_, inputs_.keyframes[0].width, inputs_.keyframes[0].height);
  const Densifier probe(options_, {});  // with sizes: whether a device's memory suffices depends on them
  options_.backend = probe.options().backend;
  options_.simd = probe.options().simd;
  inputs_.engine = engine_text(options_, probe.backend());
  inputs_.width = options_.width;
  nlohmann::ordered_json json = options_of_results(options_);
  inputs_.options_json = json.dump();
  for (const char* later : {"view_filter", "consistency", "fusion", "free_space"}) json.erase(later);
  inputs_.planes_options_json = json.dump();
  step_ = plan_step(workspace_.record(), inputs_);
  find_missing();
}

void WorkspaceStep::find_missing() {
  shortcuts_.keyframes = step_.shortcuts(options_.patchmatch.geometric_passes);
  for (const PlanEntry& entry : step_.plan.entries) {
    if (!entry.has_depth_map()) continue;
    const StepKeyframePlan& it = step_.keyframes.at(entry.id);
    if (!it.has_planes && workspace_.has_planes(it)) {
      shortcuts_.keyframes[entry.id] = {Shortcut::Planes::kResult, it.passes, false};
    }
    const bool is_there = it.points_kept || (!inputs_.ask_all_again && workspace_.has_points(it));
    if (is_there) there_.insert(entry.id);
    if (!is_there) missing_.push_back(entry.id);
  }
  shortcuts_.load = [this](std::int64_t id) {
    const StepKeyframePlan& it = step_.keyframes.at(id);
    return own(
        id, workspace_.load_planes(it.has_planes ? workspace_.record().keyframes.at(id).planes->file : it.planes_file));
  };
}

std::unique_ptr<Densifier> WorkspaceStep::densifier(DensifierCallbacks callbacks) {
  take_cloud_ = callbacks.cloud;
  callbacks.planes = [this](const PlaneMap& planes) {
    workspace_.save_planes(step_.keyframes.at(planes.keyframe_id).planes_file, planes);
  };
  callbacks.cloud = [this](const KeyframeCloud& cloud) {
    hand_on_until(cloud.keyframe_id);
    workspace_.save_points(step_.keyframes.at(cloud.keyframe_id).points_file, cloud);
    take_cloud_(cloud);
    ++next_;
  };
  return std::make_unique<Densifier>(options_, step_.plan, missing_, std::move(callbacks), shortcuts_);
}

/// Clouds that are there and come before this keyframe's; nullopt = all.
void WorkspaceStep::hand_on_until(std::optional<std::int64_t> keyframe_id) {
  for (; next_ < step_.plan.entries.size() && step_.plan.entries[next_].id != keyframe_id; ++next_) {
    const std::int64_t id = step_.plan.entries[next_].id;
    if (there_.count(id) == 0) continue;
    const StepKeyframePlan& it = step_.keyframes.at(id);
    KeyframeCloud cloud = own(id, workspace_.load_points(it.points_file));
    cloud.cam_from_world = it.pose.cam_from_world;
    cloud.scale = it.pose.scale;
    take_cloud_(cloud);
  }
}

double WorkspaceStep::scale_of(std::int64_t keyframe_id) const {
  const auto found = step_.keyframes.find(keyframe_id);
  return found == step_.keyframes.end() ? 1.0 : found->second.pose.scale;
}

void WorkspaceStep::finish() { hand_on_until(std::nullopt); }

void WorkspaceStep::commit() {
  workspace::Record record = record_of(step_, inputs_, workspace_.record());
  record.map = relative_text(arguments_.map, arguments_.workspace);
  record.images = relative_text(arguments_.images.empty() ? arguments_.video : arguments_.images, arguments_.workspace);
  for (const std::filesystem::path& target : target_paths(arguments_)) {
    const std::string text = relative_text(target, arguments_.workspace);
    if (std::find(record.outputs.begin(), record.outputs.end(), text) == record.outputs.end()) {
      record.outputs.push_back(text);
    }
  }
  workspace_.commit(std::move(record));
}

void WorkspaceStep::count_keyframes(DensifierStats& stats) const {
  stats.keyframes_added = stats.keyframes_accepted = stats.keyframes_rejected = stats.keyframes_blurred = 0;
  stats.keyframes_without_neighbour = stats.keyframes_without_range = 0;
  for (const PlanEntry& entry : step_.plan.entries) {
    ++stats.keyframes_added;
    ++(entry.used() ? stats.keyframes_accepted : stats.keyframes_rejected);
    stats.keyframes_blurred += entry.use == KeyframeUse::kBlurred;
    stats.keyframes_without_neighbour += entry.use == KeyframeUse::kNoNeighbour;
    stats.keyframes_without_range += entry.use == KeyframeUse::kNoRange;
  }
}

nlohmann::ordered_json WorkspaceStep::report() const {
  std::int64_t kept = 0, refined = 0, made = 0, found = 0, points = 0, passes = 0;
  std::map<std::string, int> reasons;
  for (const auto& [id, it] : step_.keyframes) {
    const auto shortcut = shortcuts_.keyframes.find(id);
    const bool was_found =
        shortcut != shortcuts_.keyframes.end() && shortcut->second.planes == Shortcut::Planes::kResult;
    kept += it.passes == 0;
    refined += it.has_planes && it.passes > 0;
    found += was_found;
    made += !it.has_planes && !was_found;
    passes += was_found ? 0 : it.passes;
    points += there_.count(id) != 0;
    if (!it.reason.empty()) ++reasons[it.reason];
  }
  nlohmann::ordered_json json{{"step", step_.name},
                              {"depth_maps", step_.keyframes.size()},
                              {"kept", kept},
                              {"refined", refined},
                              {"made", made},
                              {"found", found},
                              {"unfinished", step_.unfinished},
                              {"passes", passes},
                              {"points_kept", points}};
  json["reasons"] = reasons;
  return json;
}

std::string WorkspaceStep::summary() const {
  const nlohmann::ordered_json json = report();
  const auto number = [&](const char* key) { return std::to_string(json[key].get<std::int64_t>()); };
  std::string text = "workspace:   of " + number("depth_maps") + " depth maps " + number("kept") + " are kept, " +
                     number("refined") + " refined, " + number("made") + " made";
  if (json["found"] != 0) text += ", " + number("found") + " found from an interrupted run";
  const char* before = " (";
  for (const auto& [reason, count] : json["reasons"].items()) {
    text += before + reason + " " + std::to_string(count.get<int>());
    before = ", ";
  }
  if (*before == ',') text += ")";
  if (json["unfinished"] != 0) text += "; the newest " + number("unfinished") + " lack passes for now";
  return text + "; points of " + number("points_kept") + " keyframes are kept";
}

}  // namespace pmsp::tool
