// SPDX-License-Identifier: BSD-2-Clause
// `report`: page of --report from an existing cloud or workspace. The page names what is missing in these.
#include "report.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <system_error>
#include <utility>

#include <CLI/CLI.hpp>

#include "command_line.h"
#include "exit_code.h"
#include "numbers.h"
#include "pmsp/error.h"
#include "report_page.h"
#include "report_photos.h"
#include "verbs.h"
#include "web/page.h"
#include "workspace/workspace.h"
#include "workspace/workspace_cloud.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kReportAbout =
    "The page of `run --report` from a cloud (PLY, LAS, Potree) or a workspace (run --workspace), without another\n"
    "run. It omits and lists what these do not contain.\n";

constexpr const char* kReportMore =
    "Examples:\n"
    "  pmsp-densify report cloud.ply -o cloud.html\n"
    "  pmsp-densify report work/ -o mission.html";

std::int64_t points_from(const std::string& option, const std::string& text) {
  constexpr std::int64_t kMost = PageCloud::kMostPoints;
  return number_in<std::int64_t>(option.c_str(), text, 0, kMost, "a whole number from 0 to " + std::to_string(kMost));
}

int panoramas_from(const std::string& text) {
  return number_in("--report-panoramas", text, 0, 1000, "a whole number from 0 to 1000");
}

void add_points_option(CLI::App& app, const std::string& option, ReportArguments& a) {
  app.add_option_function<std::string>(
         option, [&a, option](const std::string& text) { a.points = points_from(option, text); },
         "Maximum number of points in the page, the most confident ones [0 to 5000000, 20 bytes each; default 1000000]")
      ->type_name("N")
      ->group("Output");
}

/// Command line of `report`.
struct ReportVerbArguments {
  std::filesystem::path from;  ///< cloud or workspace
  ReportArguments report;
};

/// Returns nullopt after printing help to stdout. Throws UsageError, IoError, OutputError.
std::optional<ReportVerbArguments> parse_report_arguments(int argc, const char* const* argv) {
  ReportVerbArguments a;
  bool force = false;
  CLI::App app(kReportAbout, "pmsp-densify report");
  set_up_verb(app, kReportMore);
  app.add_option("from", a.from, "Cloud or workspace")->type_name("CLOUD|WORKSPACE");
  app.add_option("-o,--output", a.report.path, "Page (HTML)")->type_name("FILE")->group("Output");
  app.add_flag("--force", force, "Overwrite an existing page")->group("Output");
  add_points_option(app, "--points", a.report);
  app.add_option("--unit", a.report.unit,
                 "Name of the unit of lengths; m is refused for a cloud without a scale [default: that of the cloud]")
      ->type_name("NAME")
      ->group("Output");
  if (!parse_words(app, {argv + 2, argv + argc})) return std::nullopt;
  refuse_extra_words(app);
  require_report_page("report");
  if (a.from.empty() || a.report.path.empty()) {
    throw UsageError("expected a cloud or a workspace, and -o FILE.html; see report --help");
  }
  std::error_code error;
  if (fs::equivalent(a.from, a.report.path, error)) {
    throw UsageError("-o " + a.report.path.string() + " would overwrite the input");
  }
  if (!force && fs::exists(a.report.path, error)) {
    throw OutputError(a.report.path.string() + ": exists already; --force overwrites it, or give another -o");
  }
  return a;
}

/// For a page with all points of the cloud.
CloudHeader header_of(CloudReader& cloud, const fs::path& page) {
  CloudHeader header;
  header.generator = version_text();
  if (page.has_parent_path()) header.scratch = page.parent_path();
  header.unit = cloud.info().unit;
  if (const auto box = bounds_of(cloud)) {
    header.center = 0.5 * (box->first + box->second);
    header.reach = std::max(0.5 * (box->second - box->first).norm(), 1e-6);
  }
  return header;
}

Json stats_of(const CloudInfo& info, std::int64_t points) {
  Json stats{{"generator", version_text()}, {"points_written", points}};
  stats["cloud"]["lengths"] = unit_text(info.unit);
  return stats;
}

std::int64_t add_points(CloudReader& cloud, ReportPage& page) {
  std::int64_t points = 0;
  cloud.read([&](const OutputPoint* some, std::size_t count) {
    page.cloud().add(some, count);
    points += static_cast<std::int64_t>(count);
  });
  return points;
}

std::int64_t report_cloud(const ReportVerbArguments& arguments, CloudReader& cloud) {
  const CloudInfo& info = cloud.info();
  const CloudHeader header = header_of(cloud, arguments.report.path);
  SlamMap map;
  map.path = arguments.from;
  ReportPage page(arguments.report, header, map, 0);
  const std::int64_t points = add_points(cloud, page);
  page.say("The page was made from a cloud alone: without keyframes, pictures, times and depth maps.");
  // Frames other than that of the map come from --up, --align or other programs.
  const bool is_of_map = info.file_from_map && info.file_from_map->rotation.isIdentity(1e-9);
  if (!is_of_map) page.set_up(Eigen::Vector3d::UnitZ());
  page.say(std::string("The cloud does not contain which way is up: heights follow its ") + (is_of_map ? "-y" : "z") +
           " axis.");
  if (!info.has_confidence) {
    page.say("The cloud contains no confidence: errors of measurements are unknown, and those shown are too large.");
  }
  if (!info.has_views) page.say("The cloud contains no number of views of its points.");
  if (!info.has_colors) page.say("The cloud contains no colours.");
  if (!info.has_normals) {
    page.leave_out_normals();
    page.say("The cloud contains no normals: walls and ceilings are not opened.");
  }
  if (info.unit.kind == CloudUnit::Kind::kUnknown) {
    page.say("The unit of the cloud's lengths is unknown" +
             (arguments.report.unit.empty() ? "." : "; " + arguments.report.unit + " is from --unit."));
  }
  Json stats = stats_of(info, points);
  stats["outputs"] = {arguments.from.string()};
  page.write(stats);
  return points;
}

/// Keyframes with an image of a workspace's record, in the order of the plan.
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

std::int64_t report_workspace(const ReportVerbArguments& arguments, workspace::WorkspaceCloud& cloud) {
  const workspace::Record& record = cloud.record();
  const CloudHeader header = header_of(cloud, arguments.report.path);
  const SlamMap map = map_of(arguments.from, record);
  ReportPage page(arguments.report, header, map, map.keyframes.size());
  const std::int64_t points = add_points(cloud, page);
  for (const PlanEntry& entry : record.plan.entries) page.set_use(entry);
  page.set_source(arguments.from);
  page.say("The page was made from a workspace: without pictures, coverage and times.");
  page.say(
      "It contains all points, in the frame of the map and in map units, regardless of the options of clouds from the "
      "workspace.");
  Json stats = stats_of(cloud.info(), points);
  stats["map"] = record.map;
  stats["images"] = record.images;
  stats["options"] = Json::parse(record.options, nullptr, false);
  stats["outputs"] = record.outputs;
  stats["workspace"] = arguments.from.string();
  page.write(stats);
  return points;
}

}  // namespace

void require_report_page(const char* option) {
  if (!web::has_report_page()) throw UsageError(std::string(option) + " is not in this build (PMSP_VIEWER is OFF)");
}

void add_report_options(CLI::App& app, ReportArguments& a) {
  const char* group = "Output";
  app.add_option("--report", a.path,
                 "Page for a browser, without network: options, quality, and points for viewing and measuring (HTML)")
      ->type_name("FILE")
      ->group(group);
  add_points_option(app, "--report-points", a);
  app.add_option(
         "--report-photos", a.photos,
         "Directory for a photo of each keyframe (JPEG, at most 2048 pixels wide) and its depth map, which the page "
         "loads when served; below the directory of the page")
      ->type_name("DIR")
      ->group(group);
  app.add_option_function<std::string>(
         "--report-panoramas", [&a](const std::string& text) { a.panoramas = panoramas_from(text); },
         "Keyframes with a photo in the page itself, at most 2048 pixels wide [0 to 1000; default 12]")
      ->type_name("N")
      ->group(group);
  app.add_option("--report-unit", a.unit,
                 "Name of the unit of lengths in the page; m is refused without --scale, --align or a scaling "
                 "--transform [default: m with one of these, else map units]")
      ->type_name("NAME")
      ->group(group);
}

void check_report(const ReportArguments& a) {
  if (!a.path.empty()) require_report_page("--report");
  if (a.photos.empty()) return;
  if (a.path.empty()) throw UsageError("--report-photos needs --report FILE");
  if (path_beside(a.path, a.photos).empty()) {
    throw UsageError("--report-photos " + a.photos.string() + " is no directory below that of --report " +
                     a.path.string() + ", from which the page loads them");
  }
}

int report(int argc, const char* const* argv) {
  const std::optional<ReportVerbArguments> arguments = parse_report_arguments(argc, argv);
  if (!arguments) return kExitOk;
  const std::unique_ptr<CloudReader> cloud = open_cloud(arguments->from);
  check_unit("--unit", arguments->report.unit, cloud->info().unit);
  auto* const workspace = dynamic_cast<workspace::WorkspaceCloud*>(cloud.get());
  const std::int64_t points =
      workspace != nullptr ? report_workspace(*arguments, *workspace) : report_cloud(*arguments, *cloud);
  std::cerr << "wrote " << arguments->report.path.string() << ": " << points << " points\n";
  return kExitOk;
}

}  // namespace pmsp::tool
