// SPDX-License-Identifier: BSD-2-Clause
#include "workspace_step.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include <opencv2/core.hpp>

#include "calibration.h"
#include "io/prior_depths.h"
#include "mission_input.h"
#include "options.h"
#include "pmsp/densifier.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"
#include "tool_files.h"
#include "workspace/fingerprint.h"
#include "workspace/loss.h"

namespace pmsp::tool {
namespace {

using ScopedTimer = TimeAccount::Scope;
using workspace::StepKeyframePlan;

/// Version of a library from OpenCV's build information: "JPEG ver 62"; the name if missing.
std::string library_text(const std::string& name) {
  std::istringstream lines(cv::getBuildInformation());
  for (std::string line; std::getline(lines, line);) {
    const std::size_t at = line.find(name + ":");
    if (at == std::string::npos || line.find_first_not_of(' ') != at) continue;
    const std::size_t open = line.rfind('('), close = line.rfind(')');
    if (open == std::string::npos || close == std::string::npos || close < open) break;
    return name + " " + line.substr(open + 1, close - open - 1);
  }
  return name;
}

/// Device models without duplicates: "NVIDIA H200" for "CUDA device 0, NVIDIA H200; device 1, NVIDIA H200"; their
/// number does not affect results.
std::string kinds_of_devices(const std::string& backend) {
  std::set<std::string> kinds;
  std::istringstream devices(backend);
  for (std::string device; std::getline(devices, device, ';');) kinds.insert(device.substr(device.find(',') + 2));
  std::string text;
  for (const std::string& kind : kinds) text += (text.empty() ? "" : "; ") + kind;
  return text;
}

std::string decoder_text(const Arguments& arguments) {
  return "OpenCV " + cv::getVersionString() + " with " + library_text(arguments.video.empty() ? "JPEG" : "avcodec");
}

/// Returns version, processor type and decoder: equal texts imply equal bytes for equal input. `options`: with
/// effective backend and simd, described by `backend`. The GPU model identifies its architecture.
std::string engine_text(const DensifierOptions& options, const std::string& backend, const Arguments& arguments) {
  std::string processor = options.simd == Simd::kScalar ? "CPU, plain code" : "CPU, fused multiply-add";
  if (options.backend == Backend::kCuda) processor = kinds_of_devices(backend);
  return version_text() + ", " + processor + ", " + decoder_text(arguments);
}

/// Returns a file's content; throws IoError if it belongs to another keyframe.
template <class T>
T own(std::int64_t id, T loaded) {
  if (loaded.keyframe_id == id) return loaded;
  throw IoError("the record of the workspace names a file of keyframe " + std::to_string(loaded.keyframe_id) +
                " as that of keyframe " + std::to_string(id) + "; delete the workspace, or give another one");
}

/// File name of an image's sharpness record, including a fingerprint of everything that it depends on.
std::string image_record_file(const workspace::StepKeyframe& it) {
  workspace::Fingerprint inputs;
  inputs.add(version_text()).add(it.looked_for).add(it.image);
  inputs.add(it.keyframe.cam_from_world.rotation.data(), 9 * sizeof(double));
  inputs.add(it.keyframe.cam_from_world.translation.data(), 3 * sizeof(double));
  for (const Landmark& landmark : it.keyframe.landmarks) {
    inputs.add(landmark.id).add(landmark.position_world.data(), 3 * sizeof(double));
  }
  return std::to_string(it.keyframe.id) + "-" + inputs.text().substr(0, 16);
}

/// Purpose of the sharpness record.
std::string looked_for_text(const DensifierOptions& options) {
  const bool reads_images = options.advanced.view_filter.enabled && options.advanced.view_filter.min_sharpness > 0.0;
  return reads_images ? "blur at a width of " + std::to_string(options.width) : "nothing";
}

/// True if most landmarks of a record are still observed; otherwise it is not comparable with newer ones.
bool is_up_to_date(const SharpnessRecord& record, const std::vector<Landmark>& landmarks) {
  std::set<std::int64_t> ids;
  for (const Landmark& landmark : landmarks) ids.insert(landmark.id);
  const auto observed = std::count_if(record.landmarks.begin(), record.landmarks.end(),
                                      [&](const LandmarkSharpness& at) { return ids.count(at.id) != 0; });
  return 2 * static_cast<std::size_t>(observed) >= record.landmarks.size();
}

}  // namespace

std::string relative_text(const std::filesystem::path& path, const std::filesystem::path& folder) {
  std::error_code error;
  const std::filesystem::path relative = std::filesystem::relative(place_of(path), place_of(folder), error);
  return error || relative.empty() ? place_of(path).string() : relative.string();
}

WorkspaceStep::WorkspaceStep(workspace::Workspace& workspace, const Arguments& arguments,
                             const DensifierOptions& options, const SlamMap& map, const RigMask& rig, bool growing,
                             TimeAccount* time)
    : workspace_(workspace),
      arguments_(arguments),
      options_(options),
      map_(map),
      time_(time),
      executor_(options.threads, options.simd),
      rig_(rig_json(rig)) {
  workspace_.lower_last_bin();
  inputs_.options = options;
  inputs_.mask = masks_text(arguments, workspace_);
  inputs_.growing = growing;
  const bool has_pages = !arguments.depth_maps.empty() || !arguments.preview.empty() ||
                         !arguments.report.path.empty() || arguments.cloud.wants_depth();
  inputs_.recompute_points = has_pages && arguments.verb != Verb::kMerge;  // merge computes nothing
}

std::set<std::int64_t> WorkspaceStep::new_images(const ImageSource& source, std::vector<SkippedKeyframe>& unreadable) {
  std::set<std::int64_t> fresh;
  const MaskSource masks(mask_options(arguments_, map_, source));
  const io::PriorDepths priors(arguments_.prior_depth, arguments_.images, map_);
  for (const std::int64_t id : source.keyframe_ids()) {
    const ImageSource::Origin origin = source.origin(id);
    const Keyframe keyframe = keyframe_of(map_, *map_.find_keyframe(id));
    workspace::StepKeyframe it;
    it.keyframe = {id, keyframe.cam_from_world, keyframe.landmarks, {}};
    it.looked_for = looked_for_text(options_);
    try {
      it.image = workspace_.fingerprint(origin.file) + (origin.frame.empty() ? "" : ", " + origin.frame);
      const std::filesystem::path mask =
          arguments_.mask.empty() || masks.is_folder() ? masks.file_for(origin.name()) : "";
      if (!mask.empty()) it.image += ", mask " + workspace_.fingerprint(mask);
      if (arguments_.no_masks && may_have_alpha(origin.file)) it.image += ", without its alpha channel";
      const std::filesystem::path prior = priors.file_for(id, origin.name());
      if (!prior.empty()) {
        it.image += ", prior depth " + workspace_.fingerprint(prior);
        if (prior.extension() == ".png") it.image += " times " + priors.unit_text();
      }
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
    }
    ids_.push_back(id);
    stock_[id] = std::move(it);
    if (!is_known && !find_image_record(id)) fresh.insert(id);
  }
  return fresh;
}

bool WorkspaceStep::find_image_record(std::int64_t keyframe_id) {
  workspace::StepKeyframe& it = stock_.at(keyframe_id);
  const std::optional<workspace::ImageRecord> record = workspace_.find_image_record(image_record_file(it));
  if (!record) return false;
  it.width = record->width;
  it.height = record->height;
  it.keyframe.sharpness = record->sharpness;
  return true;
}

void WorkspaceStep::save_image_record(std::int64_t keyframe_id) const {
  const workspace::StepKeyframe& it = stock_.at(keyframe_id);
  workspace_.save_image_record(image_record_file(it), {it.width, it.height, it.keyframe.sharpness});
}

void WorkspaceStep::add_image(const Keyframe& keyframe) {
  workspace::StepKeyframe& it = stock_.at(keyframe.id);
  it.keyframe = plan_keyframe(keyframe, options_, &executor_);
  it.width = keyframe.image.width;
  it.height = keyframe.image.height;
}

/// Sets options and engine of the inputs. `options`: with sizes, effective backend and simd.
void WorkspaceStep::describe(const DensifierOptions& options, const std::string& engine,
                             workspace::StepInputs& inputs) const {
  inputs.engine = engine;
  inputs.width = options.width;
  nlohmann::ordered_json json = options_of_results(options);
  if (!rig_.is_null()) json[workspace::kRigMask] = rig_;
  inputs.options_json = json.dump();
  for (const char* later : {"view_filter", "consistency", "fusion", "free_space"}) json.erase(later);
  inputs.planes_options_json = json.dump();
}

void WorkspaceStep::refuse_losses() const {
  const std::optional<workspace::Record>& begun = workspace_.begun();
  const workspace::Record& record = workspace_.record();
  if (arguments_.force || workspace_.has_committed() || (record.keyframes.empty() && !begun)) return;
  const workspace::RecordedKeyframe& first = (record.keyframes.empty() ? *begun : record).keyframes.begin()->second;
  DensifierOptions options = options_;
  fill_in_size(options, first.width, first.height);
  const Densifier probe(options, {});
  options.backend = probe.options().backend;
  options.simd = probe.options().simd;
  workspace::StepInputs inputs;
  inputs.mask = inputs_.mask;
  describe(options, engine_text(options, probe.backend(), arguments_), inputs);
  std::map<std::int64_t, std::string> images;
  for (const auto& [id, it] : stock_) images[id] = it.image;
  refuse_loss(record, "", inputs, images);
  if (begun) refuse_loss(*begun, " of a run that was interrupted", inputs, images);
}

/// `whose`: "" = of the last finished run.
void WorkspaceStep::refuse_loss(const workspace::Record& record, const std::string& whose,
                                const workspace::StepInputs& inputs,
                                const std::map<std::int64_t, std::string>& images) const {
  const workspace::Loss loss = loss_of(record, inputs, images);
  const auto text = [&](const std::string& path) { return place_of(arguments_.workspace / path).string(); };
  const std::string cure =
      "another --workspace, or --force to replace " + std::to_string(loss.planes) + " depth maps" + whose;
  if (loss.is_other_mission) {
    throw OutputError(arguments_.workspace.string() + ": this workspace is of " + text(record.map) + " (" +
                      text(record.images) + "), " + std::to_string(loss.keyframes) + " keyframes, of which " +
                      (loss.same == 0 ? "none has" : std::to_string(loss.same) + " have") + " the same image in " +
                      (arguments_.images.empty() ? arguments_.video : arguments_.images).string() + "; give " + cure);
  }
  if (!loss.is_nearly_all) return;
  throw OutputError(arguments_.workspace.string() + ": " + loss.difference + ": " +
                    (loss.kept == 0 ? "nothing" : std::to_string(loss.kept)) + " of " + std::to_string(loss.planes) +
                    " depth maps can be kept; give the options of these, " + cure);
}

void WorkspaceStep::begin() const {
  workspace::Record record = workspace::record_of_begun(step_.name, inputs_);
  name_inputs(record);
  workspace_.begin(std::move(record));
}

std::string WorkspaceStep::begin_run(const ImageSource& source, const Densifier& densifier) {
  std::vector<SkippedKeyframe> unreadable;
  new_images(source, unreadable);
  for (const std::int64_t id : ids_) inputs_.keyframes.push_back(std::move(stock_.at(id)));
  options_.width = densifier.options().width;
  options_.height = densifier.options().height;
  options_.backend = densifier.options().backend;
  options_.simd = densifier.options().simd;
  describe(options_, engine_text(options_, densifier.backend(), arguments_), inputs_);
  step_.name = workspace::step_name(workspace_.record(), inputs_);
  begin();
  return step_.name;
}

void WorkspaceStep::decide(const std::string& engine) {
  for (const std::int64_t id : ids_) {
    if (stock_.at(id).width > 0) inputs_.keyframes.push_back(std::move(stock_.at(id)));
  }
  if (!inputs_.keyframes.empty()) fill_in_size(options_, inputs_.keyframes[0].width, inputs_.keyframes[0].height);
  const Densifier probe(options_, {});  // with sizes, since they decide whether device memory is sufficient
  options_.backend = probe.options().backend;
  options_.simd = probe.options().simd;
  describe(options_, engine.empty() ? engine_text(options_, probe.backend(), arguments_) : engine, inputs_);
  step_ = plan_step(workspace_.record(), inputs_);
  for (workspace::StepKeyframe& it : inputs_.keyframes) std::vector<Landmark>().swap(it.keyframe.landmarks);
  reuses_ = find_reuses();
  for (const PlanEntry& entry : step_.plan.entries) {
    if (!entry.has_depth_map()) continue;
    const bool is_there = has_points(entry.id);
    if (is_there) there_.insert(entry.id);
    if (!is_there) missing_.push_back(entry.id);
  }
}

bool WorkspaceStep::has_planes(std::int64_t keyframe_id) const {
  return workspace_.has_planes(step_.keyframes.at(keyframe_id));
}

bool WorkspaceStep::has_points(std::int64_t keyframe_id) const {
  const StepKeyframePlan& it = step_.keyframes.at(keyframe_id);
  return it.points_kept || (!inputs_.recompute_points && workspace_.has_points(it));
}

/// Existing results of previous steps and of this one.
PlaneReuses WorkspaceStep::find_reuses() const {
  PlaneReuses reuses;
  reuses.keyframes = step_.reuses(options_.advanced.patchmatch.geometric_passes);
  for (const auto& [id, it] : step_.keyframes) {
    if (it.has_planes || !workspace_.has_planes(it)) continue;
    reuses.keyframes[id] = {PlaneReuse::Planes::kResult, it.passes, false};
  }
  reuses.load = [this](std::int64_t id) {
    const ScopedTimer spent(time_, Activity::kWorkspace);
    const StepKeyframePlan& it = step_.keyframes.at(id);
    return own(
        id, workspace_.load_planes(it.has_planes ? workspace_.record().keyframes.at(id).planes->file : it.planes_file));
  };
  return reuses;
}

/// For points after all planes are made: existing ones are final.
PlaneReuses WorkspaceStep::final_planes() const {
  PlaneReuses reuses;
  for (const auto& [id, it] : step_.keyframes) {
    if (workspace_.has_planes(it)) reuses.keyframes[id] = {PlaneReuse::Planes::kStart, 0, false};
  }
  reuses.load = [this](std::int64_t id) { return own(id, workspace_.load_planes(step_.keyframes.at(id).planes_file)); };
  return reuses;
}

std::vector<std::int64_t> WorkspaceStep::planes_lacking(const std::vector<std::int64_t>& points_of,
                                                        const std::set<std::int64_t>& without) const {
  std::set<std::int64_t> required_planes;
  for (const std::int64_t id : points_of) {
    const StepKeyframePlan& it = step_.keyframes.at(id);
    required_planes.insert(it.required_planes.begin(), it.required_planes.end());
  }
  std::vector<std::int64_t> lacking;
  for (const std::int64_t id : required_planes) {
    if (!has_planes(id) && without.count(id) == 0) lacking.push_back(id);
  }
  return lacking;
}

std::unique_ptr<PlannedDensifier> WorkspaceStep::planes_densifier(
    const std::vector<std::int64_t>& ids, const std::function<void(std::int64_t keyframe_id)>& made) const {
  PlannedCallbacks callbacks;
  callbacks.planes = [this, made](const PlaneMap& planes) {
    save(planes);
    made(planes.keyframe_id);
  };
  return std::make_unique<PlannedDensifier>(options_, step_.plan, ids, std::move(callbacks), find_reuses());
}

std::unique_ptr<PlannedDensifier> WorkspaceStep::points_densifier(
    const std::vector<std::int64_t>& ids, bool planes_are_there,
    const std::function<void(std::int64_t keyframe_id)>& made) const {
  PlannedCallbacks callbacks;
  callbacks.planes = [this](const PlaneMap& planes) { save(planes); };
  callbacks.cloud = [this, made](const KeyframeCloud& cloud) {
    save(cloud);
    made(cloud.keyframe_id);
  };
  return std::make_unique<PlannedDensifier>(options_, step_.plan, ids, std::move(callbacks),
                                            planes_are_there ? final_planes() : find_reuses());
}

void WorkspaceStep::save(const PlaneMap& planes) const {
  const ScopedTimer spent(time_, Activity::kWorkspace);
  workspace_.save_planes(step_.keyframes.at(planes.keyframe_id).planes_file, planes);
}

void WorkspaceStep::save(const KeyframeCloud& cloud) const {
  if (arguments_.delete_workspace) return;  // fast to recompute from planes
  const ScopedTimer spent(time_, Activity::kWorkspace);
  workspace_.save_points(step_.keyframes.at(cloud.keyframe_id).points_file, cloud);
}

void WorkspaceStep::join(bool is_repeated) {
  missing_.clear();
  is_joined_ = true;
  is_repeated_ = is_repeated;
}

std::unique_ptr<PlannedDensifier> WorkspaceStep::densifier(PlannedCallbacks callbacks) {
  take_cloud_ = callbacks.cloud;
  if (arguments_.delete_workspace) {
    callbacks.wants_planes = [this](std::int64_t /*keyframe_id*/) { return pace_.is_worth_keeping(options_); };
  }
  callbacks.planes = [this](const PlaneMap& planes) { save(planes); };
  callbacks.cloud = [this](const KeyframeCloud& cloud) {
    emit_clouds_before(cloud.keyframe_id);
    save(cloud);
    take_cloud_(cloud);
    ++next_;
  };
  return std::make_unique<PlannedDensifier>(options_, step_.plan, missing_, std::move(callbacks), reuses_);
}

/// Emits existing clouds before this keyframe's; nullopt = all.
void WorkspaceStep::emit_clouds_before(std::optional<std::int64_t> keyframe_id) {
  const ScopedTimer spent(time_, Activity::kWorkspace);
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

void WorkspaceStep::finish() { emit_clouds_before(std::nullopt); }

void WorkspaceStep::commit(std::size_t lenses_looked_at, workspace::RecordedCloud cloud) {
  const ScopedTimer spent(time_, Activity::kWorkspace);
  workspace::Record record = record_of(step_, inputs_, workspace_.record());
  name_inputs(record);
  for (const std::filesystem::path& target : target_paths(arguments_)) {
    const std::string text = relative_text(target, arguments_.workspace);
    if (std::find(record.outputs.begin(), record.outputs.end(), text) == record.outputs.end()) {
      record.outputs.push_back(text);
    }
  }
  record.cloud = std::move(cloud);
  record.lenses_looked_at = std::max(record.lenses_looked_at, lenses_looked_at);
  if (is_repeated_) record.step = workspace_.record().step;
  workspace_.commit(std::move(record));
}

void WorkspaceStep::name_inputs(workspace::Record& record) const {
  record.map = relative_text(arguments_.map, arguments_.workspace);
  record.images = relative_text(arguments_.images.empty() ? arguments_.video : arguments_.images, arguments_.workspace);
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
    const auto reuse = reuses_.keyframes.find(id);
    const bool was_found = reuse != reuses_.keyframes.end() && reuse->second.planes == PlaneReuse::Planes::kResult;
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
  if (json["found"] != 0)
    text += ", " + number("found") + (is_joined_ ? " found from shards" : " found from an interrupted run");
  const char* before = " (";
  for (const auto& [reason, count] : json["reasons"].items()) {
    text += before + reason + " " + std::to_string(count.get<int>());
    before = ", ";
  }
  if (*before == ',') text += ")";
  if (json["unfinished"] != 0) text += "; " + number("unfinished") + " lack passes until a later run";
  return text + "; points of " + number("points_kept") + " keyframes are kept";
}

bool PlanesPace::is_worth_keeping(const DensifierOptions& options) {
  constexpr double kMostBytesPerSecond = 100e6;
  constexpr double kPlaneBytes = 4 * sizeof(float);
  if (!first_) {
    first_ = Clock::now();
    return false;
  }
  bytes_ += kPlaneBytes * options.width * options.height;
  return bytes_ < kMostBytesPerSecond * seconds_since(*first_);
}

PlaneMapWriter::PlaneMapWriter(workspace::Workspace& workspace, const Arguments& arguments,
                               const DensifierOptions& options, const SlamMap& map, const RigMask& rig,
                               const ImageSource& source, TimeAccount& time)
    : workspace_(workspace),
      arguments_(arguments),
      options_(options),
      map_(map),
      rig_(rig),
      source_(source),
      time_(time) {}

bool PlaneMapWriter::wants_planes(const Densifier& densifier) { return pace_.is_worth_keeping(densifier.options()); }

void PlaneMapWriter::keep(const PlaneMap& planes, const Densifier& densifier) {
  const ScopedTimer spent(time_, Activity::kWorkspace);
  if (step_.empty()) {
    WorkspaceStep step(workspace_, arguments_, options_, map_, rig_, false, nullptr);
    step_ = step.begin_run(source_, densifier);
  }
  workspace_.save_planes(workspace::planes_name(planes.keyframe_id, step_), planes);
}

}  // namespace pmsp::tool
