// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/commands.h"

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <set>

#include "pmsp-eval/calibration_plot.h"
#include "pmsp-eval/depth_files.h"
#include "pmsp-eval/error_images.h"
#include "pmsp-eval/ground_truth.h"
#include "pmsp-eval/parallel.h"
#include "pmsp-eval/report.h"
#include "pmsp-eval/statistics.h"
#include "pmsp/error.h"
#include "pmsp/io/files.h"
#include "pmsp/io/map.h"
#include "pmsp/io/ply.h"

namespace pmsp::eval {
namespace {

namespace fs = std::filesystem;

std::vector<TimedPose> read_keyframes(const CommonArguments& common) {
  return common.map.empty() ? read_tum(common.trajectory) : trajectory_of(read_map(common.map));
}

Json input_json(const CommonArguments& common) {
  return {{"truth", common.truth.string()},
          {"keyframes", common.map.empty() ? common.trajectory.string() : common.map.string()}};
}

/// Table to standard output; it makes way for JSON that goes there.
void deliver(const CommonArguments& common, const Json& json, const std::string& table) {
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  const bool json_to_stdout = common.json == "-";
  if (!common.json.empty() && !json_to_stdout) write_file(common.json, text);
  (json_to_stdout ? std::cerr : std::cout) << table << std::flush;
  if (json_to_stdout) std::cout << text << std::flush;
  if (!std::cout) throw OutputError("standard output cannot be written");
}

fs::path picture_path(const fs::path& folder, const char* prefix, std::int64_t id) {
  char name[64];
  std::snprintf(name, sizeof(name), "%s_%06lld.png", prefix, static_cast<long long>(id));
  return folder / name;
}

/// Ids of `count` keyframes, evenly spread; none where no pictures are wanted.
template <class Items, class Id>
std::set<std::int64_t> pictured(const RenderArguments& render, const Items& items, const Id& id) {
  std::set<std::int64_t> ids;
  if (render.folder.empty()) return ids;
  for (const std::size_t i : spread_indices(items.size(), static_cast<std::size_t>(render.keyframes))) {
    ids.insert(id(items[i]));
  }
  return ids;
}

ViewMeasures views_with_pictures(const AlignedCloud& cloud, const Alignment& alignment, const GroundTruth& truth,
                                 const CloudArguments& arguments) {
  if (!arguments.render.folder.empty()) make_folder(arguments.render.folder);
  const auto shown = spread_indices(cloud.keyframes.size(), static_cast<std::size_t>(arguments.views.max_keyframes));
  const auto wanted =
      pictured(arguments.render, shown, [&](std::size_t keyframe) { return cloud.keyframes[keyframe].id; });
  const ViewObserver observe = [&](const View& view, const Image<float>& range, const Image<float>& error) {
    if (wanted.count(view.keyframe_id) == 0) return;
    write_view_image(picture_path(arguments.render.folder, "view", view.keyframe_id), range, error,
                     arguments.views.max_relative_error);
  };
  return measure_views(cloud, alignment, truth, arguments.views, observe);
}

/// A depth map with the truth of its keyframe.
struct Pair {
  DepthFile file;
  const GroundTruth::RangeMap* truth = nullptr;
};

std::vector<Pair> pair_with_truth(const std::vector<DepthFile>& files, const std::vector<TimedPose>& keyframes,
                                  const Alignment& alignment, const GroundTruth& truth) {
  std::vector<Pair> pairs;
  for (const DepthFile& file : files) {
    const auto keyframe = std::find_if(keyframes.begin(), keyframes.end(),
                                       [&](const TimedPose& pose) { return pose.id == file.keyframe_id; });
    if (keyframe == keyframes.end()) {
      throw InvalidInput(file.path.string() + ": the map has no keyframe " + std::to_string(file.keyframe_id) +
                         "; depth maps are named by keyframe id, and must come from the same map");
    }
    const int row = alignment.truth_row[static_cast<std::size_t>(keyframe - keyframes.begin())];
    const GroundTruth::RangeMap* range = row >= 0 ? truth.find(row) : nullptr;
    if (range != nullptr) pairs.push_back({file, range});
  }
  if (pairs.empty()) {
    throw InvalidInput("none of the " + std::to_string(files.size()) +
                       " depth maps belongs to a keyframe with a true range map; check --time-offset and --gt-fps");
  }
  return pairs;
}

/// Pixels that are compared with their confidence at most, over all maps: about 400 MB.
constexpr std::size_t kMaxSamples = 16'000'000;

/// What a map adds to the calibration: none without a confidence. Large missions are thinned evenly.
std::vector<ConfidenceSample> samples_of(const Pair& pair, const Image<float>& error, std::size_t maps) {
  const Image<float> confidence = load_confidence(pair.file.path, error.width(), error.height());
  if (confidence.empty()) return {};
  const std::size_t stride = (error.size() * maps + kMaxSamples - 1) / kMaxSamples;
  return calibration_samples(error, confidence, stride);
}

std::optional<Calibration> calibrate_all(std::vector<std::vector<ConfidenceSample>>& maps) {
  std::vector<ConfidenceSample> samples;
  for (std::vector<ConfidenceSample>& map : maps) {
    samples.insert(samples.end(), map.begin(), map.end());
    map = {};
  }
  if (samples.empty()) return std::nullopt;
  return calibrate(samples);
}

}  // namespace

void run_cloud(const CommonArguments& common, CloudArguments arguments) {
  arguments.surface.threads = arguments.measures.threads = arguments.views.threads = common.threads;
  arguments.measures.voxel_m = arguments.surface.voxel_m;
  const GroundTruth truth(common.truth, common.truth_fps);
  const std::vector<TimedPose> keyframes = read_keyframes(common);
  const Alignment alignment = align(keyframes, truth.trajectory(), common.alignment);
  // Only the positions are kept of what the file holds: clouds are large.
  const AlignedCloud cloud =
      align_cloud(read_ply(arguments.cloud).positions, keyframes, alignment.truth_from_map, truth.origin());
  const ViewMeasures views = views_with_pictures(cloud, alignment, truth, arguments);
  const LabelOptions label_options = arguments.views.labels();
  const Behind behind = {cloud.points.size(),
                         count_behind(cloud.points, views.truth, label_options.max_offset, common.threads)};
  const CloudMeasures measures = measure_cloud(cloud, build_surface(truth, arguments.surface), arguments.measures);

  Json json = {{"cloud", arguments.cloud.string()}};
  json.update(input_json(common));
  json["alignment"] = to_json(alignment);
  json["points_not_finite"] = cloud.dropped;
  json["views"] = to_json(views);
  json["behind"] = to_json(behind);
  json["surface"] = to_json(measures);
  deliver(common, json,
          "cloud       " + arguments.cloud.string() + "\n" + to_table(alignment) + to_table(views, arguments.views) +
              to_table(behind, label_options) + to_table(measures));
}

void run_depth(const CommonArguments& common, DepthArguments arguments) {
  const auto files = list_depth_files(arguments.inputs, arguments.png_scale, arguments.keyframe);
  const GroundTruth truth(common.truth, common.truth_fps);
  const std::vector<TimedPose> keyframes = read_keyframes(common);
  const Alignment alignment = align(keyframes, truth.trajectory(), common.alignment);
  arguments.measures.scale = arguments.labels.scale = alignment.truth_from_map.scale;
  const auto pairs = pair_with_truth(files, keyframes, alignment, truth);
  if (!arguments.render.folder.empty()) make_folder(arguments.render.folder);
  const auto wanted = pictured(arguments.render, pairs, [](const Pair& pair) { return pair.file.keyframe_id; });

  std::vector<KeyframeDepth> maps(pairs.size());
  std::vector<std::vector<ConfidenceSample>> samples(pairs.size());
  parallel_chunks(pairs.size(), 1, common.threads, [&](std::size_t i, std::size_t) {
    const std::int64_t id = pairs[i].file.keyframe_id;
    const Image<float> depth = load_depth(pairs[i].file.path, arguments.png_scale);
    Image<float> error;
    const Image<float> range = GroundTruth::load(*pairs[i].truth);
    DepthMeasureOptions measures = arguments.measures;
    LabelOptions labels = arguments.labels;
    if (arguments.own_scales) measures.scale = labels.scale = own_scale(depth, range);
    maps[i] = {id, depth.width(), depth.height(), measure_depth(depth, range, measures, &error), {}};
    maps[i].labels = measure_labels(depth, error, range, GroundTruth::load_labels(*pairs[i].truth), labels);
    samples[i] = samples_of(pairs[i], error, pairs.size());
    if (wanted.count(id) > 0) {
      write_depth_error_image(picture_path(arguments.render.folder, "depth_error", id), error, 720);
    }
  });

  const std::optional<Calibration> calibration = calibrate_all(samples);
  if (!arguments.calibration.empty()) {
    if (!calibration) {
      throw InvalidInput(
          "--calibration: no pixel has an estimate, a truth and a confidence; expected "
          "confidence_<keyframe id>.pfm beside the depth maps");
    }
    write_calibration_plot(arguments.calibration, *calibration);
  }

  Json json = input_json(common);
  json["alignment"] = to_json(alignment);
  json["without_truth"] = files.size() - pairs.size();
  json["depth"] = to_json(maps);
  json["calibration"] = calibration ? to_json(*calibration) : Json();
  std::string table =
      to_table(alignment) + to_table(maps, arguments.labels) + (calibration ? to_table(*calibration) : "");
  if (files.size() > pairs.size()) {
    table += "  " + std::to_string(files.size() - pairs.size()) + " further depth maps have no truth\n";
  }
  deliver(common, json, table);
}

void run_align(const CommonArguments& common, const AlignArguments& arguments) {
  std::vector<TimedPose> keyframes = read_keyframes(common);
  if (common.truth.empty()) {
    write_tum(arguments.write_trajectory, keyframes);
    std::cout << "trajectory  " << keyframes.size() << " poses in " << arguments.write_trajectory.string() << std::endl;
    return;
  }
  const Alignment alignment = align(keyframes, read_true_trajectory(common.truth), common.alignment);
  if (!arguments.write_trajectory.empty()) {
    for (TimedPose& pose : keyframes) {
      if (arguments.aligned) pose.world_from_cam = alignment.truth_from_map * pose.world_from_cam;
    }
    write_tum(arguments.write_trajectory, keyframes);
  }
  Json json = input_json(common);
  json["alignment"] = to_json(alignment);
  deliver(common, json, to_table(alignment));
}

}  // namespace pmsp::eval
