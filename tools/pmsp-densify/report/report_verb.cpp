// SPDX-License-Identifier: BSD-2-Clause
// `report`: the page of --report from what there is already, a cloud or a workspace. What neither holds is left out,
// and the page says so.
#include <algorithm>
#include <iostream>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include "exit_code.h"
#include "pmsp/error.h"
#include "pmsp/io/ply.h"
#include "pmsp/io/workspace/workspace.h"
#include "report_arguments.h"
#include "report_page.h"
#include "verbs.h"

namespace pmsp::tool {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

/// Of all points, for the header.
class Bounds {
 public:
  void add(const Eigen::Vector3d& x) {
    low_ = is_empty_ ? x : Eigen::Vector3d(low_.cwiseMin(x));
    high_ = is_empty_ ? x : Eigen::Vector3d(high_.cwiseMax(x));
    is_empty_ = false;
  }
  void put(CloudHeader& header) const {
    header.center = 0.5 * (low_ + high_);
    header.reach = std::max(0.5 * (high_ - low_).norm(), 1e-6);
  }

 private:
  bool is_empty_ = true;
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero(), high_ = low_;
};

CloudHeader header_beside(const fs::path& page) {
  CloudHeader header;
  header.generator = version_text();
  if (page.has_parent_path()) header.scratch = page.parent_path();
  return header;
}

Json stats_of(std::int64_t points) { return {{"generator", version_text()}, {"points_written", points}}; }

std::int64_t report_cloud(const ReportVerbArguments& arguments) {
  const PlyCloud cloud = read_ply(arguments.from);
  CloudHeader header = header_beside(arguments.report.path);
  Bounds bounds;
  for (const Eigen::Vector3d& position : cloud.positions) bounds.add(position);
  bounds.put(header);
  SlamMap map;
  map.path = arguments.from;
  ReportPage page(arguments.report, header, map, 0);
  for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
    OutputPoint point;
    point.position = cloud.positions[i];
    if (!cloud.normals.empty()) point.normal = cloud.normals[i];
    point.color = cloud.colors.empty() ? Rgb{200, 200, 200} : cloud.colors[i];
    if (!cloud.confidence.empty()) point.confidence = cloud.confidence[i];
    if (!cloud.views.empty()) point.views = cloud.views[i];
    point.keyframe_id = -1;
    page.cloud().add(&point, 1);
  }
  page.say("The page was made from a cloud alone: it knows no keyframes, pictures, times or depth maps.");
  if (cloud.confidence.empty()) {
    page.say(
        "The cloud holds no confidence: errors of measurements cannot be told, and those that are shown are too "
        "large.");
  }
  if (cloud.views.empty()) page.say("The cloud does not say how many keyframes have seen a point.");
  if (cloud.colors.empty()) page.say("The cloud holds no colours.");
  if (cloud.normals.empty()) {
    page.leave_out_normals();
    page.say("The cloud holds no normals: walls and ceilings are not opened.");
  }
  const auto points = static_cast<std::int64_t>(cloud.positions.size());
  Json stats = stats_of(points);
  stats["outputs"] = {arguments.from.string()};
  page.write(stats);
  return points;
}

/// The flight as a workspace knows it: keyframes with an image, in the order of the plan.
SlamMap map_of(const fs::path& folder, const workspace::Record& record) {
  SlamMap map;
  map.path = record.map.empty() ? folder : fs::path(record.map);
  for (const auto& [id, it] : record.keyframes) {
    MapKeyframe keyframe;
    keyframe.id = id;
    keyframe.cam_from_world = it.pose.cam_from_world;
    map.keyframes.push_back(std::move(keyframe));
  }
  for (MapKeyframe& keyframe : map.keyframes) {
    const auto& entries = record.plan.entries;
    const auto found =
        std::find_if(entries.begin(), entries.end(), [&](const PlanEntry& entry) { return entry.id == keyframe.id; });
    keyframe.timestamp = static_cast<double>(found - entries.begin());
  }
  return map;
}

std::int64_t report_workspace(const ReportVerbArguments& arguments) {
  const workspace::Workspace workspace(arguments.from);
  const workspace::Record& record = workspace.record();
  const auto each_cloud = [&](const auto& take) {
    for (const auto& [id, it] : record.keyframes) {
      if (!it.points) continue;
      const KeyframeCloud cloud = workspace.load_points(it.points->file);
      std::vector<OutputPoint> placed(cloud.points.size());
      place_points(cloud, it.pose, {}, 0, cloud.points.size(), placed.data());
      take(placed);
    }
  };
  CloudHeader header = header_beside(arguments.report.path);
  Bounds bounds;
  std::int64_t points = 0;
  each_cloud([&](const std::vector<OutputPoint>& placed) {
    for (const OutputPoint& point : placed) bounds.add(point.position);
    points += static_cast<std::int64_t>(placed.size());
  });
  bounds.put(header);
  const SlamMap map = map_of(arguments.from, record);
  ReportPage page(arguments.report, header, map, map.keyframes.size());
  each_cloud([&](const std::vector<OutputPoint>& placed) { page.cloud().add(placed.data(), placed.size()); });
  for (const PlanEntry& entry : record.plan.entries) page.set_use(entry);
  page.say(
      "The page was made from a workspace: it has no pictures and no coverage, and does not know how long it took.");
  page.say(
      "Points are in the frame and the unit of the map, all of them, whatever clouds made from the workspace hold.");
  Json stats = stats_of(points);
  stats["map"] = record.map;
  stats["images"] = record.images;
  stats["options"] = Json::parse(record.options, nullptr, false);
  stats["outputs"] = record.outputs;
  stats["workspace"] = arguments.from.string();
  page.write(stats);
  return points;
}

}  // namespace

int report(int argc, const char* const* argv) {
  const std::optional<ReportVerbArguments> arguments = parse_report_arguments(argc, argv);
  if (!arguments) return kExitOk;
  const std::int64_t points = arguments->is_workspace ? report_workspace(*arguments) : report_cloud(*arguments);
  std::cerr << "wrote " << arguments->report.path.string() << ": " << points << " points\n";
  return kExitOk;
}

}  // namespace pmsp::tool
