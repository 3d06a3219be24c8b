// SPDX-License-Identifier: BSD-2-Clause
#include "shared_step.h"

#include <algorithm>
#include <utility>

#include "calibration.h"
#include "mission_input.h"
#include "options.h"
#include "pmsp/error.h"
#include "tool_files.h"

namespace pmsp::tool {
namespace {

/// Returns "shard 3", "shards 3 and 5", "shards 3, 5 and 6".
std::string shards_text(const std::set<int>& shards) {
  std::string text = shards.size() == 1 ? "shard " : "shards ";
  std::size_t left = shards.size();
  for (const int shard : shards) {
    text += std::to_string(shard);
    --left;
    if (left > 0) text += left == 1 ? " and " : ", ";
  }
  return text;
}

std::string keyframes_text(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " keyframe" : " keyframes");
}

std::string shared_path(const std::filesystem::path& path, const Arguments& arguments) {
  return path.empty() ? "" : relative_text(path, arguments.workspace);
}

/// Fingerprint of the map and its companion files; of a folder (COLMAP), of the files in it.
std::string map_bytes(const Arguments& arguments, workspace::Workspace& workspace) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  if (std::filesystem::is_directory(arguments.map, error)) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(arguments.map, error)) {
      const std::string ending = entry.path().extension().string();
      if (entry.is_regular_file(error) && (ending == ".bin" || ending == ".txt" || ending == ".npz"))
        files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
  } else {
    files.push_back(arguments.map);
  }
  for (const std::filesystem::path& more : {arguments.points, arguments.image_list, arguments.camera_from_body}) {
    if (!more.empty()) files.push_back(more);
  }
  std::string text;
  for (const std::filesystem::path& file : files) text += (text.empty() ? "" : " ") + workspace.fingerprint(file);
  return text;
}

}  // namespace

workspace::ShardJob shared_job(const Arguments& arguments, const DensifierOptions& options,
                               workspace::Workspace& workspace) {
  workspace::ShardJob job;
  job.from = workspace.record().step;
  job.options = to_json(options).dump();
  job.map = shared_path(arguments.map, arguments);
  job.map_bytes = map_bytes(arguments, workspace);
  job.images = shared_path(arguments.images, arguments);
  job.video = shared_path(arguments.video, arguments);
  job.mask = shared_path(arguments.mask, arguments);
  job.mask_bytes = masks_text(arguments, workspace);
  job.mask_nadir = arguments.mask_nadir;
  job.mask_zenith = arguments.mask_zenith;
  job.no_masks = arguments.no_masks;
  job.prior_depth = shared_path(arguments.prior_depth, arguments);
  job.fps = arguments.fps;
  job.frame_offset = arguments.frame_offset;
  job.presentation_times = arguments.presentation_times;
  job.points = shared_path(arguments.points, arguments);
  job.image_list = shared_path(arguments.image_list, arguments);
  job.camera_from_body = shared_path(arguments.camera_from_body, arguments);
  job.component = arguments.component.value_or(-1);
  return job;
}

SharedStep::SharedStep(const WorkspaceStep& step, std::vector<workspace::ShardMarker> markers, int count)
    : step_(step), markers_(std::move(markers)), count_(count) {
  for (const PlanEntry& entry : step.step().plan.entries) {
    if (entry.has_depth_map()) depth_maps_.push_back(entry.id);
  }
}

std::set<std::int64_t> SharedStep::without(workspace::Wave wave) const {
  std::set<std::int64_t> ids;
  for (const workspace::ShardMarker& marker : markers_) {
    const bool tells = marker.failure.empty() && marker.wave == wave && marker.step == step_.step().name;
    if (tells) ids.insert(marker.without.begin(), marker.without.end());
  }
  return ids;
}

int SharedStep::shard_of(std::int64_t keyframe_id) const {
  const auto found = std::find(depth_maps_.begin(), depth_maps_.end(), keyframe_id);
  const auto place = static_cast<std::size_t>(found - depth_maps_.begin());
  int shard = 0;
  while (place >= workspace::id_range_of({shard, count_}, depth_maps_.size()).last) ++shard;
  return shard;
}

std::string SharedStep::who_lacks(const std::vector<std::int64_t>& planes,
                                  const std::vector<std::int64_t>& points) const {
  std::set<int> shards;
  for (const auto* ids : {&planes, &points}) {
    for (const std::int64_t id : *ids) shards.insert(shard_of(id));
  }
  std::string what;
  if (!planes.empty()) what = "planes of " + keyframes_text(planes.size());
  if (!points.empty()) what += (what.empty() ? "points of " : ", points of ") + keyframes_text(points.size());
  const std::size_t missing = planes.size() + points.size();
  return shards_text(shards) + " of " + std::to_string(count_) +
         (shards.size() == 1 ? " has not finished (" : " have not finished (") + what +
         (missing == 1 ? " is" : " are") + " missing)" + failures(shards);
}

/// Errors of the first ones, as far as recorded.
std::string SharedStep::failures(const std::set<int>& shards) const {
  constexpr int kMost = 3;
  std::string text;
  int told = 0;
  for (const workspace::ShardMarker& marker : markers_) {
    if (marker.failure.empty() || marker.shard.count != count_ || shards.count(marker.shard.index) == 0) continue;
    if (++told > kMost) return text + "; more have failed";
    text += "; shard " + std::to_string(marker.shard.index) + " failed on " + marker.host + ": " + marker.failure;
  }
  return text;
}

void SharedStep::require_all(const workspace::ShardJob& job) const {
  for (const workspace::ShardMarker& marker : markers_) {
    const std::string other = marker.failure.empty() ? workspace::difference(marker, job) : "";
    if (other.empty()) continue;
    throw InvalidInput("shard " + text_of(marker.shard) + " (" + name_of(marker.wave) + ", on " + marker.host +
                       ") does not match the others: " + other + "; repeat it with equal inputs, then merge");
  }
  const std::set<std::int64_t> no_planes = without(workspace::Wave::kPlanes);
  const std::set<std::int64_t> no_points = without(workspace::Wave::kPoints);
  std::vector<std::int64_t> planes, points;
  for (const std::int64_t id : depth_maps_) {
    if (!step_.has_planes(id) && no_planes.count(id) == 0) planes.push_back(id);
    if (!step_.has_points(id) && no_points.count(id) == 0) points.push_back(id);
  }
  if (planes.empty() && points.empty()) return;
  throw IoError(who_lacks(planes, points) + "; run them again, then merge");
}

Merge::Merge(const Arguments& given, workspace::Workspace& the_workspace) : workspace(the_workspace), arguments(given) {
  const std::string& step = workspace.record().step;
  std::optional<workspace::ShardJob> found = workspace.shards().job(step);
  if (!found) {
    found = workspace.shards().ended_job(step);
    is_repeated = true;
  }
  if (!found) {
    throw InvalidInput(
        given.workspace.string() +
        ": no shards for the current contents of this workspace; expected those of `pmsp-densify run MAP --images DIR "
        "--workspace " +
        given.workspace.string() + " --shard K/N`");
  }
  job = *found;
  const auto there = [&](const std::string& path) {
    return path.empty() ? std::filesystem::path() : place_of(place_of(given.workspace) / path);
  };
  arguments.map = there(job.map);
  arguments.images = there(job.images);
  arguments.video = there(job.video);
  arguments.mask = there(job.mask);
  arguments.mask_nadir = job.mask_nadir;
  arguments.mask_zenith = job.mask_zenith;
  arguments.no_masks = job.no_masks;
  arguments.prior_depth = there(job.prior_depth);
  arguments.fps = job.fps;
  arguments.frame_offset = job.frame_offset;
  arguments.presentation_times = job.presentation_times;
  arguments.allow_missing = true;  // ensured by the shards
  arguments.points = there(job.points);
  arguments.image_list = there(job.image_list);
  arguments.camera_from_body = there(job.camera_from_body);
  if (job.component >= 0) arguments.component = job.component;
  apply_json(options, nlohmann::json::parse(job.options), workspace.shards().path().string());
  const std::optional<workspace::Record>& begun = workspace.begun();
  rig = recorded_rig(is_repeated || !begun ? workspace.record() : *begun);
  workspace::ShardJob now = shared_job(arguments, options, workspace);
  now.count = job.count;
  const std::string other = workspace::difference(now, job);
  if (!other.empty()) throw InvalidInput(given.workspace.string() + ": cannot be merged: " + other);
  if (job.engine.rfind(version_text() + ",", 0) != 0) {
    throw InvalidInput(given.workspace.string() + ": cannot be merged by " + version_text() +
                       ": the shards' engine is \"" + job.engine + "\"; merge with their version");
  }
  options.backend = Backend::kCpu;  // nothing is computed
  options.simd = Simd::kAuto;
  options.threads = 0;
}

void Merge::join(WorkspaceStep& step) const {
  const std::string where = arguments.workspace.string() + ": ";
  if (!is_repeated && step.step().name != job.step) {
    throw InvalidInput(where +
                       "cannot be merged: images or contents of the workspace have changed since the shards ran; "
                       "restore them, or run the shards again after deleting " +
                       workspace.shards().path().string());
  }
  if (is_repeated && step.has_work()) {
    throw InvalidInput(
        where + "already merged, and its inputs have changed since; run the shards again, or a run without --shard");
  }
  try {
    if (!is_repeated) SharedStep(step, workspace.shards().markers(), job.count).require_all(job);
  } catch (const InvalidInput& error) {
    throw InvalidInput(where + error.what());
  } catch (const IoError& error) {
    throw IoError(where + error.what());
  }
  step.join(is_repeated);
}

}  // namespace pmsp::tool
