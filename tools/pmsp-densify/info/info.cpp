// SPDX-License-Identifier: BSD-2-Clause
#include <exception>
#include <filesystem>
#include <iostream>
#include <memory>
#include <system_error>
#include <vector>

#include "calibration.h"
#include "cloud_arguments.h"
#include "disk_space.h"
#include "estimates.h"
#include "exit_code.h"
#include "io/plan_io.h"
#include "mission_input.h"
#include "numbers.h"
#include "options.h"
#include "pmsp/densifier.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"
#include "progress.h"
#include "tool_files.h"
#include "verbs.h"
#include "workspace_step.h"

namespace pmsp::tool {
namespace {

using Json = nlohmann::ordered_json;

Json cameras_json(const SlamMap& map) {
  Json cameras = Json::array();
  for (const MapCamera& camera : map.cameras) {
    cameras.push_back({{"name", camera.name}, {"width", camera.width}, {"height", camera.height}, {"fps", camera.fps}});
  }
  return cameras;
}

Json trajectory_json(const SlamMap& map) {
  const std::vector<const MapKeyframe*> keyframes = in_time_order(map);
  std::vector<double> steps;
  double length = 0.0;
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    steps.push_back((keyframes[i]->cam_from_world.center() - keyframes[i - 1]->cam_from_world.center()).norm());
    length += steps.back();
  }
  const double first = keyframes.empty() ? 0.0 : keyframes.front()->timestamp;
  const double last = keyframes.empty() ? 0.0 : keyframes.back()->timestamp;
  return {{"first_timestamp", first},
          {"last_timestamp", last},
          {"path_length", length},
          {"keyframe_distance",
           {{"min", percentile(steps, 0.0)}, {"median", percentile(steps, 50.0)}, {"max", percentile(steps, 100.0)}}}};
}

/// Distances from a keyframe to its observed landmarks.
std::vector<double> landmark_depths(const SlamMap& map, const MapKeyframe& keyframe) {
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  std::vector<double> depths;
  depths.reserve(keyframe.observations.size());
  for (const MapObservation& observation : keyframe.observations) {
    const MapLandmark* landmark = map.find_landmark(observation.landmark_id);
    if (landmark != nullptr) depths.push_back((landmark->position_world - center).norm());
  }
  return depths;
}

Json landmarks_json(const SlamMap& map) {
  std::vector<double> depths;
  std::size_t observations = 0;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const std::vector<double> own = landmark_depths(map, keyframe);
    depths.insert(depths.end(), own.begin(), own.end());
    observations += keyframe.observations.size();
  }
  return {{"count", map.landmarks.size()},
          {"observations", observations},
          {"observations_per_keyframe",
           map.keyframes.empty() ? 0.0 : static_cast<double>(observations) / static_cast<double>(map.keyframes.size())},
          {"observations_skipped", map.observations_skipped},
          {"observations_repeated", map.observations_repeated},
          {"depth",
           {{"p2", percentile(depths, 2.0)}, {"median", percentile(depths, 50.0)}, {"p98", percentile(depths, 98.0)}}}};
}

Json images_json(const ImageSource& source, const std::vector<SkippedKeyframe>& skipped_keyframes) {
  Json images{{"description", source.description()},
              {"found", source.keyframe_ids().size()},
              {"keyframe_ids", source.keyframe_ids()},
              {"missing", Json::array()}};
  for (const SkippedKeyframe& skipped : skipped_keyframes) {
    images["missing"].push_back({{"keyframe_id", skipped.keyframe_id}, {"reason", skipped.reason}});
  }
  return images;
}

/// Keyframes with a decodable image, for a plan. `check`: receives the others.
std::vector<PlanKeyframe> keyframes_with_image(const SlamMap& map, ImageSource& source, const DensifierOptions& options,
                                               MissionInput::ImageCheck& check) {
  std::vector<PlanKeyframe> keyframes;
  io::Decoder decoder(source);
  check.skipped = source.skipped();
  for (;;) {
    const io::Decoded decoded = decoder.next();
    check.skipped.insert(check.skipped.end(), decoded.skipped.begin(), decoded.skipped.end());
    if (!decoded.item) break;
    const MapKeyframe* found = map.find_keyframe(decoded.item->keyframe_id);
    if (found == nullptr) continue;
    Keyframe keyframe = keyframe_of(map, *found);
    keyframe.image = decoded.item->image.view();
    keyframes.push_back(plan_keyframe(keyframe, options));
  }
  return keyframes;
}

Json refusal_json(const std::exception_ptr& refusal) {
  try {
    std::rethrow_exception(refusal);
  } catch (const std::exception& error) {
    return {{"message", error.what()}, {"exit_code", exit_code_of(error)}};
  }
}

Json plan_figures(const Plan& plan, const std::filesystem::path& path) {
  Json uses = Json::object();
  for (const PlanEntry& entry : plan.entries) {
    const std::string use = name_of(entry.use);
    uses[use] = uses.value(use, 0) + 1;
  }
  return {{"file", path.string()}, {"keyframes", plan.entries.size()}, {"uses", uses}};
}

std::string number(const Json& value) { return number_text(value.get<double>(), "%.4g"); }

void print_images(const Json& j) {
  const Json& images = j["images"];
  std::cout << "images:     " << images["description"].get<std::string>() << "\n            " << images["found"]
            << " of " << j["keyframes"] << " keyframes have one\n";
  for (const Json& missing : images["missing"]) {
    std::cout << "  keyframe " << missing["keyframe_id"] << ": " << missing["reason"].get<std::string>() << "\n";
  }
}

void print_plan(const Json& plan) {
  std::cout << "plan:       " << plan["file"].get<std::string>() << ", " << plan["keyframes"] << " keyframes\n";
  for (const auto& [use, count] : plan["uses"].items()) std::cout << "  " << use << ": " << count << "\n";
}

void print(const Json& j) {
  std::cout << "map:        " << j["map"].get<std::string>() << "\nformat:     " << j["format"].get<std::string>()
            << "\n";
  for (const Json& camera : j["cameras"]) {
    std::cout << "camera:     " << camera["name"].get<std::string>() << ", equirectangular, " << camera["width"]
              << " x " << camera["height"] << " px, " << number(camera["fps"]) << " fps\n";
  }
  const Json& flight = j["trajectory"];
  const Json& step = flight["keyframe_distance"];
  const double span = flight["last_timestamp"].get<double>() - flight["first_timestamp"].get<double>();
  const std::string times = format("%.3f to %.3f s, %.3f s", flight["first_timestamp"].get<double>(),
                                   flight["last_timestamp"].get<double>(), span);
  std::cout << "keyframes:  " << j["keyframes"] << ", timestamps " << times << "\n"
            << "path:       " << number(flight["path_length"]) << " map units; from keyframe to keyframe "
            << number(step["min"]) << " to " << number(step["max"]) << ", median " << number(step["median"]) << "\n";
  const Json& landmarks = j["landmarks"];
  std::cout << "landmarks:  " << landmarks["count"] << ", " << landmarks["observations"] << " observations, "
            << number(landmarks["observations_per_keyframe"])
            << " per keyframe; ignored: " << landmarks["observations_skipped"] << " of unknown landmarks, "
            << landmarks["observations_repeated"] << " repeated\n"
            << "depth:      " << number(landmarks["depth"]["p2"]) << " to " << number(landmarks["depth"]["p98"])
            << " map units (2nd to 98th percentile), median " << number(landmarks["depth"]["median"]) << "\n";
  if (j.contains("reprojection")) {
    std::cout << "projection: landmarks are " << number(j["reprojection"]["median_error_px"])
              << " px from their observations (median of " << j["reprojection"]["observations"]
              << "); no other convention fits better\n";
  }
  for (const Json& remark : j["remarks"]) std::cout << "remark:     " << remark.get<std::string>() << "\n";
  if (j.contains("images")) print_images(j);
  if (j.contains("plan")) print_plan(j["plan"]);
}

/// Returns the workspace; nullptr if a run would create one. Throws if a run would reject it or its outputs.
std::unique_ptr<workspace::Workspace> check_places(const Arguments& arguments) {
  std::unique_ptr<workspace::Workspace> workspace;
  std::error_code ignored;
  if (!arguments.workspace.empty()) check_names(arguments);
  if (std::filesystem::exists(arguments.workspace, ignored) &&
      !std::filesystem::is_empty(arguments.workspace, ignored)) {
    workspace = std::make_unique<workspace::Workspace>(arguments.workspace);
  }
  check_targets(arguments, workspace ? recorded_outputs(arguments, *workspace) : std::vector<std::filesystem::path>());
  return workspace;
}

/// Throws OutputError if a run would refuse to replace the workspace's depth maps.
void check_losses(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
                  const SlamMap& map, const ImageSource& images) {
  const RigMask rig = arguments.find_rig ? recorded_rig(workspace.record()) : RigMask{};
  WorkspaceStep step(workspace, arguments, options, map, rig, arguments.growing, nullptr);
  std::vector<SkippedKeyframe> unreadable;
  step.new_images(images, unreadable);
  step.refuse_losses();
}

}  // namespace

void info(const Arguments& given) {
  const DensifierOptions options = effective_options(given);
  Arguments arguments = given;
  Progress progress(ProgressMode::kNone, true, false);
  MissionInput input(arguments, progress, options.threads);
  input.read_map();
  arguments = with_images(given, input.map);
  const SlamMap& map = input.map;
  const bool is_dry_run = !given.images.empty() || !given.video.empty();
  // The first error of a run is thrown after everything known has been printed.
  std::exception_ptr refusal;
  const auto attempt = [&refusal](const auto& step) {
    try {
      step();
    } catch (const std::exception&) {
      if (!refusal) refusal = std::current_exception();
    }
  };
  std::unique_ptr<workspace::Workspace> workspace;
  attempt([&] { workspace = check_places(given); });
  if (!is_dry_run && !(arguments.images.empty() && arguments.video.empty())) {
    try {
      input.open_images();
    } catch (const Error& error) {  // images named only by the map may be elsewhere
      input.remarks.push_back(std::string("no images: ") + error.what());
    }
  }
  MissionInput::ImageCheck check;
  if (is_dry_run || input.images) {
    attempt([&] {
      if (!input.images) input.open_images();
      input.check_poses();
      input.find_frame();
      check.skipped = input.images->skipped();
      check = input.check_images();
      const std::string warning = check.pairing ? io::warning_of(*check.pairing, true) : "";
      if (!warning.empty()) progress.warning(warning);
    });
    attempt([&] { input.open_prior_depths(); });
    attempt([&] {
      if (workspace && input.images) check_losses(*workspace, arguments, options, map, *input.images);
    });
    attempt([&] {
      DensifierOptions engine = options;
      if (engine.advanced.free_space.whole_mission) engine.scratch_folder = scratch_folder(arguments).string();
      const Densifier starts(engine, {});
    });
  }
  Json json{{"map", map.path.string()},
            {"format", map.format},
            {"cameras", cameras_json(map)},
            {"keyframes", map.keyframes.size()},
            {"trajectory", trajectory_json(map)},
            {"landmarks", landmarks_json(map)},
            {"remarks", input.remarks},
            {"component", map.component},
            {"component_keyframes", map.component_keyframes}};
  if (input.convention.observations > 0) {
    json["reprojection"] = {{"observations", input.convention.observations},
                            {"median_error_px", input.convention.median_error_px}};
  }
  const bool reads_images = input.images && !refusal && !arguments.plan.empty();
  const Plan plan = make_plan(reads_images ? keyframes_with_image(map, *input.images, options, check)
                                           : keyframes_without_image(map, input.images, options),
                              options);
  if (!arguments.plan.empty() && !refusal) {
    write_plan(arguments.plan, plan);
    json["plan"] = plan_figures(plan, arguments.plan);
  }
  std::string budget;
  try {
    Budget forecast = estimate_budget({map, plan, options, check.width, check.height, measure_cpu_pace(options)});
    if (is_dry_run && input.images) {
      attempt([&] {
        DensifierOptions sized = options;
        sized.width = forecast.width;
        sized.height = forecast.height;
        const double more = memory_of_outputs(arguments, sized, map, *input.images);
        forecast.memory.host += more;
        forecast.memory.gpu_host += more;
      });
    }
    json["budget"] = to_json(forecast);
    budget = budget_text(forecast);
    if (is_dry_run && input.images) {
      const double in_workspace = workspace ? 0.0 : 1.0;  // share to be computed is unknown
      attempt([&] {
        const std::string warning = check_disk_space(disk_needs(arguments, forecast, *input.images, in_workspace));
        if (!warning.empty()) progress.warning(warning);
      });
    }
  } catch (const InvalidInput& error) {
    json["budget"] = {{"error", error.what()}};
    if (is_dry_run && !refusal) refusal = std::current_exception();
    if (!is_dry_run) budget = std::string("a run:      refused: ") + error.what() + "\n";
  }
  if (input.images) json["images"] = images_json(*input.images, check.skipped);
  if (!input.mask_report.json.is_null()) json["mask"] = input.mask_report.json;
  json["warnings"] = progress.warnings();
  if (refusal) json["refused"] = refusal_json(refusal);
  if (arguments.json) {
    std::cout << json_text(json);
  } else {
    print(json);
    if (!input.mask_report.text.empty()) std::cout << "masks:      " << input.mask_report.text << "\n";
    std::cout << budget;
  }
  if (refusal) std::rethrow_exception(refusal);
}

}  // namespace pmsp::tool
