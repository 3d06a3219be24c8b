// SPDX-License-Identifier: BSD-2-Clause
// `convert`: streams a cloud or workspace to other formats, another frame or unit, or a subset.
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "cloud_report.h"
#include "convert_arguments.h"
#include "exit_code.h"
#include "export/files.h"
#include "interrupt.h"
#include "map_input.h"
#include "pmsp/io/cloud.h"
#include "progress.h"
#include "report_page.h"
#include "verbs.h"
#include "workspace/workspace_cloud.h"

namespace pmsp::tool {
namespace {

using Json = nlohmann::ordered_json;
using workspace::WorkspaceCloud;

std::string lengths_text(const CloudUnit& unit) {
  return unit.kind == CloudUnit::Kind::kUnknown ? "unit of lengths not known" : "lengths in " + unit_text(unit);
}

class Conversion {
 public:
  explicit Conversion(const ConvertArguments& arguments)
      : arguments_(arguments),
        progress_(ProgressMode::kPlain, arguments.quiet, false),
        cloud_(open_cloud(arguments.from)),
        workspace_(dynamic_cast<const WorkspaceCloud*>(cloud_.get())) {
    const CloudInfo& info = cloud_->info();
    find_frame();
    const Similarity file_from_map = frame_.file_from_map * info.file_from_map.value_or(Similarity{});
    say_input();
    const CloudAmount& amount = arguments.cloud.amount;
    const bool is_same = frame_.file_from_map.is_identity() && frame_.unit.kind == info.unit.kind &&
                         frame_.unit.by == info.unit.by && !amount.crop && !amount.thinning.is_needed();
    header_.generator = version_text();
    header_.comments = comments(file_from_map, is_same);
    header_.file_from_map = file_from_map;
    header_.unit = frame_.unit;
    header_.resolution = arguments.cloud.resolution;
    header_.double_positions = arguments.cloud.double_positions || info.double_positions;
    set_labels();
    header_.scratch = scratch_folder(arguments.scratch, arguments.cloud);
  }

  void operator()() {
    const InterruptGuard guard(nullptr);
    progress_.stage("reading " + arguments_.from.string());
    find_size(guard);
    CloudOutput output(header_, arguments_.cloud.amount, arguments_.cloud.targets());
    progress_.stage("writing " + text_of_outputs());
    if (workspace_ != nullptr) {
      workspace_->each([&](const KeyframeCloud& cloud) {
        guard.check();
        output.add(cloud);
      });
    } else {
      cloud_->read([&](const OutputPoint* points, std::size_t count) {
        guard.check();
        output.add(points, count, frame_.file_from_map);
      });
    }
    output.complete();
    guard.check();
    if (output.points() == 0) {
      throw EmptyResult("no points: " +
                        (output.points_in() == 0
                             ? arguments_.from.string() + " contains none"
                             : "none of " + std::to_string(output.points_in()) + " points lies in the box of --crop") +
                        "; nothing was written");
    }
    output.commit();
    progress_.message("wrote " + text_of_outputs() + ": " + count_text(output.points()) + " points" +
                      (output.points() < output.points_in() ? " of " + count_text(output.points_in()) : "") + ", " +
                      lengths_text(frame_.unit));
  }

 private:
  /// Keyframes in the frame of the input cloud.
  SlamMap cameras() const {
    SlamMap map;
    if (!arguments_.map.empty()) {
      Arguments only;
      only.map = arguments_.map;
      map = read_map(only);
    } else if (workspace_ != nullptr) {
      for (const auto& [id, it] : workspace_->record().keyframes) {
        MapKeyframe keyframe;
        keyframe.id = id;
        keyframe.timestamp = std::numeric_limits<double>::quiet_NaN();
        keyframe.cam_from_world = it.pose.cam_from_world;
        map.keyframes.push_back(std::move(keyframe));
      }
    }
    if (map.keyframes.empty()) return map;
    const std::optional<Similarity>& file_from_map = cloud_->info().file_from_map;
    if (!file_from_map) {
      throw InvalidInput(arguments_.from.string() +
                         ": contains no transform from the frame of --map; give --transform, or --align with a "
                         "table of points");
    }
    for (MapKeyframe& keyframe : map.keyframes) {
      keyframe.cam_from_world = (*file_from_map * keyframe.cam_from_world.inverse()).inverse();
    }
    return map;
  }

  /// Sets `frame_`, relative to the frame of the input.
  void find_frame() {
    FrameOptions options = arguments_.cloud.frame;
    const bool needs_cameras = options.up || !options.align.empty();
    const SlamMap map = needs_cameras ? cameras() : SlamMap{};
    if (options.up && map.keyframes.empty()) {
      throw UsageError(
          "--up needs the cameras, which a cloud does not contain; give --map MAP, or the workspace as IN");
    }
    frame_ = find_cloud_frame(options, map);
    if (const std::optional<KnownLength>& length = arguments_.length) {
      const double now = (frame_.file_from_map * length->to - frame_.file_from_map * length->from).norm();
      const double scale = length->metres / now;
      frame_.file_from_map =
          Similarity{scale, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()} * frame_.file_from_map;
      frame_.unit = {CloudUnit::Kind::kMetres, "--length"};
    }
    if (frame_.unit.kind != CloudUnit::Kind::kMetres) frame_.unit = cloud_->info().unit;
  }

  std::vector<std::string> lacks() const {
    const CloudInfo& info = cloud_->info();
    std::vector<std::string> all;
    for (const auto& [has, what] : {std::pair{info.has_normals, "normals"},
                                    {info.has_colors, "colours"},
                                    {info.has_confidence, "confidence"},
                                    {info.has_views, "views"}}) {
      if (!has) all.emplace_back(what);
    }
    return all;
  }

  void say_input() {
    const CloudInfo& info = cloud_->info();
    progress_.message(arguments_.from.string() + ": " + info.format +
                      (info.points > 0 ? ", " + count_text(info.points) + " points" : "") + ", " +
                      lengths_text(info.unit));
    std::string text_of_lacks;
    for (const std::string& what : lacks()) text_of_lacks += (text_of_lacks.empty() ? "" : ", ") + what;
    if (!text_of_lacks.empty()) {
      progress_.message("no " + text_of_lacks + " in it: written as 0, colours as grey");
    }
    if (!frame_.description.empty()) progress_.message("cloud: " + frame_.description);
    if (const double scale = frame_.file_from_map.scale; scale != 1.0) {
      char text[64];
      std::snprintf(text, sizeof(text), "scale: %.9g", scale);
      progress_.message(text);
    }
  }

  /// Comments of the input, with the new frame.
  std::vector<std::string> comments(const Similarity& file_from_map, bool is_same) const {
    const std::string frame_of_map = "frame of the SLAM map", normals = "normals face the camera", cloud = "cloud {";
    const CloudInfo& info = cloud_->info();
    const CloudAmount& amount = arguments_.cloud.amount;
    if (workspace_ != nullptr) {
      std::vector<std::string> all = workspace_->record().cloud.comments;
      add_frame_comments(all, file_from_map, frame_.unit, amount);
      return all;
    }
    if (is_same && (lacks().empty() || info.file_from_map)) return info.comments;
    std::vector<std::string> all;
    Json json = frame_json(file_from_map, frame_.unit, amount);
    if (!lacks().empty()) json["lacks"] = lacks();
    for (const std::string& comment : info.comments) {
      if (comment.rfind(cloud, 0) == 0) {
        const Json before = Json::parse(comment.substr(cloud.size() - 1), nullptr, false);
        for (const char* key : {"crop", "voxel", "max_points"}) {  // they refer to the frame of the input
          if (before.is_object() && before.contains(key)) json["from"][key] = before.at(key);
        }
      } else if (comment.rfind(frame_of_map, 0) == 0) {
        all.push_back(normals);
      } else {
        all.push_back(comment);
      }
    }
    all.push_back("cloud " + json.dump(-1, ' ', false, Json::error_handler_t::replace));
    return all;
  }

  /// Coordinate system and date of a LAS file.
  void set_labels() {
    const CloudInfo& info = cloud_->info();
    if (!arguments_.cloud.crs.empty()) {
      header_.wkt = read_wkt(arguments_.cloud.crs);
    } else if (!info.wkt.empty() && frame_.file_from_map.is_identity()) {
      header_.wkt = info.wkt;
    } else if (!info.wkt.empty()) {
      progress_.warning("the coordinate system of " + arguments_.from.string() +
                        " is dropped, since the cloud is transformed; give another one with --crs");
    }
    const bool has_date = arguments_.cloud.year != 0;
    header_.year = has_date ? arguments_.cloud.year : info.year;
    header_.day_of_year = has_date ? arguments_.cloud.day_of_year : info.day_of_year;
  }

  /// Sets `center` and `reach`: from the workspace's run, else from the points.
  void find_size(const InterruptGuard& guard) {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    double reach = 0.0;
    if (workspace_ != nullptr) {
      center = workspace_->record().cloud.center;
      reach = workspace_->record().cloud.reach;
    }
    if (!(reach > 0.0)) {
      const auto box = bounds_of(*cloud_);
      guard.check();
      if (box) center = 0.5 * (box->first + box->second);
      if (box) reach = 0.5 * (box->second - box->first).norm();
    }
    header_.center = frame_.file_from_map * center;
    header_.reach = frame_.file_from_map.scale * (reach > 0.0 ? reach : 1.0);
  }

  std::string text_of_outputs() const {
    std::string text;
    for (const std::filesystem::path& path : arguments_.cloud.paths) text += (text.empty() ? "" : ", ") + path.string();
    return text;
  }

  const ConvertArguments& arguments_;
  Progress progress_;
  const std::unique_ptr<CloudReader> cloud_;
  const WorkspaceCloud* const workspace_;  ///< nullptr if the input is a cloud
  CloudFrame frame_;                       ///< `file_from_map` is relative to the frame of the input
  CloudHeader header_;
};

}  // namespace

int convert(int argc, const char* const* argv) {
  const std::optional<ConvertArguments> arguments = parse_convert_arguments(argc, argv);
  if (!arguments) return kExitOk;
  Conversion conversion(*arguments);
  conversion();
  return kExitOk;
}

}  // namespace pmsp::tool
