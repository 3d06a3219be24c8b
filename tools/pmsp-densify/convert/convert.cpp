// SPDX-License-Identifier: BSD-2-Clause
// `convert`: streams a cloud or workspace to other formats, another frame or unit, or a subset.
#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "arguments.h"
#include "cloud_arguments.h"
#include "command_line.h"
#include "exit_code.h"
#include "mission_input.h"
#include "numbers.h"
#include "pmsp/io/cloud.h"
#include "process.h"
#include "progress.h"
#include "tool_files.h"
#include "verbs.h"
#include "workspace/workspace_cloud.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using workspace::WorkspaceCloud;

/// Known distance between two points.
struct KnownLength {
  Eigen::Vector3d from, to;  ///< in the frame and unit of the input
  double metres = 0.0;
};

/// Command line of `convert`.
struct ConvertArguments {
  std::filesystem::path from;  ///< cloud or workspace
  CloudArguments cloud;
  std::optional<KnownLength> length;
  std::filesystem::path map;      ///< for --up and --align; "" = none
  std::filesystem::path scratch;  ///< "" = folder of the first output
  bool force = false;
  bool quiet = false;
};

constexpr const char* kConvertAbout =
    "Converts a cloud (PLY, LAS or Potree) or a workspace (run --workspace) to another format, frame, unit or amount,\n"
    "without images. --align, --up, --transform and --scale apply to the frame of IN instead of that of the map, in\n"
    "this order; the header of OUT contains the whole transform from the map.\n";

constexpr const char* kConvertMore =
    "Examples:\n"
    "  pmsp-densify convert cloud.ply -o cloud.las\n"
    "  pmsp-densify convert cloud.ply -o metres.ply --length 0.1,-0.2,1.5 0.1,0.9,1.5 2.01\n"
    "  pmsp-densify convert work/ -o up.ply -o up.potree --up --scale 1.8\n"
    "  pmsp-densify convert cloud.ply -o part.las --crop -5,-5,0,5,5,3 --voxel 0.05";

std::optional<Eigen::Vector3d> point_from(const std::string& text) {
  const auto numbers = numbers_from<3>(text);
  if (!numbers) return std::nullopt;
  const Eigen::Vector3d point(numbers->data());
  return (point.array().abs() > 1e12).any() ? std::nullopt : std::optional(point);
}

KnownLength length_from(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  const bool is_whole = words.size() == 3;
  const auto from = is_whole ? point_from(words[0]) : std::nullopt, to = is_whole ? point_from(words[1]) : std::nullopt;
  const auto metres = is_whole ? number_from<double>(words[2]) : std::nullopt;
  if (!from || !to || !metres || !(*metres > 0.0 && *metres <= 1e12)) {
    throw UsageError("--length is \"" + text +
                     "\"; expected two points of IN and the metres between them, such as 0,0,1.5 0,1.2,1.5 2.01");
  }
  if (!((*to - *from).norm() > 0.0)) throw UsageError("--length: the two points are equal; expected different ones");
  return {*from, *to, *metres};
}

void check_frame(const ConvertArguments& a) {
  check_cloud_arguments(a.cloud);
  for (const CloudOutput::Target& target : a.cloud.targets()) {
    if (!is_dataset(*target.format)) continue;
    throw UsageError("--output " + target.path.string() + ": " + target.format->name +
                     " is a dataset of images, which a cloud does not contain; write it with `run -o`");
  }
  if (a.cloud.frame.align == kAlignExif) {
    throw UsageError("--align exif needs the images, which convert does not read; use it with `run`");
  }
  if (a.length && a.cloud.frame.scale) throw UsageError("--length and --scale exclude each other: both set the scale");
  if (a.length && !a.cloud.frame.align.empty()) {
    throw UsageError("--length and --align exclude each other: both set the scale");
  }
}

/// Throws if outputs would overwrite the input, or exist.
void check_outputs(const ConvertArguments& a) {
  std::error_code ignored;
  const fs::path input = place_of(a.from);
  for (const fs::path& path : a.cloud.paths) {
    const fs::path place = place_of(path);
    const bool is_inside = fs::is_directory(input, ignored) &&
                           std::mismatch(input.begin(), input.end(), place.begin(), place.end()).first == input.end();
    if (place == input || is_inside) throw UsageError("--output " + path.string() + " would overwrite the input");
  }
  Arguments all;
  all.map = a.map;
  all.points = a.from;
  all.cloud = a.cloud;
  all.force = a.force;
  check_targets(all);
}

/// Returns nullopt if help was printed to stdout. Throws UsageError, IoError, OutputError.
std::optional<ConvertArguments> parse_convert_arguments(int argc, const char* const* argv) {
  ConvertArguments a;
  a.cloud.paths.clear();
  std::vector<std::string> length;
  CLI::App app(kConvertAbout, "pmsp-densify convert");
  set_up_verb(app, kConvertMore);
  app.add_option("from", a.from, "Cloud or workspace")->type_name("IN");
  add_cloud_options(app, a.cloud);
  app.add_flag("--force", a.force, "Overwrite existing outputs")->group("Output");
  app.add_option("--length", length,
                 "Set the scale by a known distance: two points in the coordinates of IN, and the metres between them")
      ->expected(3)
      ->type_name("X,Y,Z X,Y,Z M")
      ->group("Frame and amount of the cloud");
  app.add_option("--map", a.map,
                 "SLAM map with the cameras, for --up or keyframes in --align, if IN does not contain them")
      ->type_name("MAP")
      ->group("Frame and amount of the cloud");
  app.add_option("--scratch", a.scratch, "Existing directory for temporary data [default: that of the first output]")
      ->type_name("DIR")
      ->group("Output");
  app.add_flag("-q,--quiet", a.quiet, "Warnings and errors only")->group("Behaviour");
  app.remove_option(app.get_option("--dataset-points"));
  app.get_option("--output")
      ->description(
          "Result; may be given several times. The format follows from the extension: .ply, .splat.ply, .las or "
          ".potree, a directory; from a workspace also the maps .bt, .ot and .pgm");
  if (!parse_words(app, {argv + 2, argv + argc})) return std::nullopt;
  refuse_extra_words(app);
  if (a.from.empty() || a.cloud.paths.empty()) {
    throw UsageError("expected a cloud or a workspace, and -o OUT; see convert --help");
  }
  if (!length.empty()) a.length = length_from(length);
  check_frame(a);
  check_outputs(a);
  return a;
}

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
    check_normals();
    find_frame();
    const Similarity file_from_map = frame_.file_from_map * info.file_from_map.value_or(Similarity{});
    say_input();
    const CloudSelection& amount = arguments.cloud.amount;
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
    if (arguments.cloud.has_map()) set_map();
  }

  void operator()() {
    const InterruptGuard guard(nullptr);
    progress_.stage("reading " + arguments_.from.string());
    find_size(guard);
    CloudOutput output(header_, arguments_.cloud.amount, arguments_.cloud.targets());
    progress_.stage("writing " + arguments_.cloud.text());
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
    progress_.message("wrote " + arguments_.cloud.text() + ": " + count_text(output.points()) + " points" +
                      (output.points() < output.points_in() ? " of " + count_text(output.points_in()) : "") + ", " +
                      lengths_text(frame_.unit));
  }

 private:
  void check_normals() const {
    if (cloud_->info().has_normals) return;
    for (const CloudOutput::Target& target : arguments_.cloud.targets()) {
      if (target.format->name != std::string("splat")) continue;
      throw InvalidInput(arguments_.from.string() + ": contains no normals, along which the splats of " +
                         target.path.string() +
                         " are thin; add normals, as with CloudCompare, or convert the cloud "
                         "of a run");
    }
  }

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
      progress_.message(number_text(scale, "scale: %.9g"));
    }
  }

  /// Comments of the input, with the new frame.
  std::vector<std::string> comments(const Similarity& file_from_map, bool is_same) const {
    const std::string frame_of_map = "frame of the SLAM map", normals = "normals face the camera", cloud = "cloud {";
    const CloudInfo& info = cloud_->info();
    const CloudSelection& amount = arguments_.cloud.amount;
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

  /// For maps: cameras and size of cells.
  void set_map() {
    if (workspace_ == nullptr) {
      throw UsageError("a map for robots needs the keyframes that see each point, which " + arguments_.from.string() +
                       " does not contain; write it with `run`, or convert a workspace (run --workspace)");
    }
    check_map_units(arguments_.cloud, frame_.unit);
    const workspace::Record& record = workspace_->record();
    std::vector<double> ranges;
    int width = Json::parse(record.options).value("width", 0);
    for (const auto& [id, keyframe] : record.keyframes) {
      header_.cameras[id] = header_.file_from_map * keyframe.pose.cam_from_world.inverse();
      for (const workspace::RecordedRange& range : keyframe.ranges) ranges.push_back(range.range);
      width = width > 0 ? width : keyframe.width;
    }
    set_map_options(header_, arguments_.cloud, ranges, width);
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
