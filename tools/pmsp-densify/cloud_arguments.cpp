// SPDX-License-Identifier: BSD-2-Clause
#include "cloud_arguments.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <utility>

#include <CLI/CLI.hpp>

#include "arguments.h"
#include "depth_output.h"
#include "exit_code.h"
#include "export/files.h"
#include "export/robot_map.h"
#include "numbers.h"
#include "options.h"
#include "pmsp/io/cloud.h"

namespace pmsp::tool {
namespace {

const char* const kOutput = "Output";
const char* const kFrame = "Frame and amount of the cloud";
const char* const kMap = "Maps for robots (.bt, .ot, .pgm)";

std::int64_t count_from(const char* option, const std::string& text) {
  return number_in<std::int64_t>(option, text, 1, INT64_MAX, "a whole number of points from 1");
}

Box box_from(const std::string& text) {
  if (const auto v = numbers_from<6>(text)) {
    const Box box{Eigen::Vector3d(v->data()), Eigen::Vector3d(v->data() + 3)};
    if ((box.low.array() <= box.high.array()).all()) return box;
  }
  throw UsageError("--crop is \"" + text +
                   "\"; expected two opposite corners, x,y,z,X,Y,Z with x <= X, y <= Y, z <= Z, such as -5,-5,0,5,5,3");
}

void set_date(const std::string& text, CloudArguments& arguments) {
  const auto part = [&](std::size_t at, std::size_t size) {
    return text.size() == 10 ? number_from<int>(text.substr(at, size)).value_or(0) : 0;
  };
  const int year = part(0, 4), month = part(5, 2), day = part(8, 2);
  const bool is_leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
  const std::array<int, 12> days{31, is_leap ? 29 : 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  const bool is_date = text.size() == 10 && text[4] == '-' && text[7] == '-' && year > 0 && month >= 1 && month <= 12 &&
                       day >= 1 && day <= days[static_cast<std::size_t>(month - 1)];
  if (!is_date) throw UsageError("--date is \"" + text + "\"; expected a day, YYYY-MM-DD, such as 2026-03-14");
  arguments.year = year;
  arguments.day_of_year = day;
  for (int before = 1; before < month; ++before) arguments.day_of_year += days[static_cast<std::size_t>(before - 1)];
}

std::string help_of_output() {
  std::string text = "Cloud; may be given several times. The format follows from the extension: ";
  for (const CloudFormat& format : cloud_formats()) {
    text += std::string(format.extension) + (format.is_folder() ? ", a directory (" : " (") + format.what + "), ";
  }
  return text.substr(0, text.size() - 2) + " [default cloud.ply]";
}

void add_files(CLI::App& app, CloudArguments& a) {
  app.add_option("-o,--output", a.paths, help_of_output())
      ->type_name("FILE")
      ->group(kOutput)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--format", a.formats,
                 "Formats of the outputs, in the order of -o, regardless of extensions: " + names_of_formats())
      ->type_name("NAME")
      ->group(kOutput)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_flag("--double", a.double_positions,
               "PLY: coordinates with 64 instead of 32 bits (always used far from the origin)")
      ->group(kOutput);
  app.add_option_function<std::string>(
         "--resolution", [&a](const std::string& text) { a.resolution = positive_from("--resolution", text); },
         "LAS, Potree: step of the integer coordinates [unit of the cloud; default: about a ten-millionth of the "
         "mission's extent]")
      ->type_name("U")
      ->group(kOutput);
  app.add_option("--crs", a.crs, "LAS: file with the coordinate reference system of the cloud, as WKT")
      ->type_name("FILE")
      ->group(kOutput);
  app.add_option_function<std::string>(
         "--date", [&a](const std::string& text) { set_date(text, a); }, "LAS: date of capture [default: none]")
      ->type_name("YYYY-MM-DD")
      ->group(kOutput);
  app.add_option_function<std::string>(
         "--dataset-points", [&a](const std::string& text) { a.dataset_points = count_from("--dataset-points", text); },
         "COLMAP, nerfstudio: maximum number of points of a dataset [default 1000000]")
      ->type_name("N")
      ->group(kOutput);
}

void add_frame(CLI::App& app, CloudArguments& a) {
  app.add_option(
         "--align", a.frame.align,
         "Aligns the cloud by a similarity to the positions in this table: lines [NAME] x y z X Y Z (point in the map, "
         "of convert: in IN; its target in metres), ID X Y Z or IMAGE X Y Z (keyframe, position of its camera), or "
         "timestamp tx ty tz qx qy qz qw "
         "(TUM trajectory); exif: to the camera positions in the images' EXIF data (GPS), in "
         "metres")
      ->type_name("FILE")
      ->group(kFrame);
  app.add_option_function<std::string>(
         "--align-time-offset",
         [&a](const std::string& text) {
           a.frame.align_time_offset = number_in("--align-time-offset", text, -1e12, 1e12, "seconds");
         },
         "Offset added to the keyframes' timestamps, for --align with a trajectory [s; default 0]")
      ->type_name("S")
      ->group(kFrame);
  app.add_flag("--up", a.frame.up,
               "Rotate the cloud so that z points upwards, by the mean vertical axis of the cameras")
      ->group(kFrame);
  app.add_option("--transform", a.frame.transform,
                 "File with a 4 x 4 matrix (rotation, scale, translation) that is applied after --align or --up")
      ->type_name("FILE")
      ->group(kFrame);
  app.add_option_function<std::string>(
         "--scale", [&a](const std::string& text) { a.frame.scale = positive_from("--scale", text); },
         "Metres per unit of the cloud, applied last: the cloud is then in metres; 1 if it is in metres [default: "
         "none, "
         "the cloud is in map units]")
      ->type_name("S")
      ->group(kFrame);
  app.add_option_function<std::string>(
         "--crop", [&a](const std::string& text) { a.amount.crop = box_from(text); },
         "Only points in a box in the frame of the cloud, given by two corners")
      ->type_name("x,y,z,X,Y,Z")
      ->group(kFrame);
  app.add_option_function<std::string>(
         "--voxel", [&a](const std::string& text) { a.amount.thinning.voxel = positive_from("--voxel", text); },
         "Only the most confident point of each cube with sides of this length [unit of the cloud]")
      ->type_name("L")
      ->group(kFrame);
  app.add_option_function<std::string>(
         "--max-points",
         [&a](const std::string& text) { a.amount.thinning.max_points = count_from("--max-points", text); },
         "Maximum number of points, selected evenly")
      ->type_name("N")
      ->group(kFrame);
}

void add_map(CLI::App& app, MapArguments& a) {
  const auto add_length = [&](const char* name, std::optional<double>& value, const char* what) {
    app.add_option_function<std::string>(
           name, [&value, name](const std::string& text) { value = positive_from(name, text); }, what)
        ->type_name("L")
        ->group(kMap);
  };
  add_length(
      "--cell-size", a.cell_size,
      "Side of the cells [unit of the cloud; default: 1, 2 or 5 times a power of ten, at least 1.5 times the spacing "
      "of adjacent pixels at the median distance of the landmarks; for a grid at most --robot-step]. Points more than "
      "1000 cells from their keyframe are left out");
  app.add_option_function<std::string>(
         "--least-rays",
         [&a](const std::string& text) {
           a.least_rays = number_in("--least-rays", text, 1, 255, "a whole number of rays, 1 to 255");
         },
         "Least number of rays, from a keyframe to a cell with points that it sees, that make a cell free [1 to 255; "
         "default 3]")
      ->type_name("N")
      ->group(kMap);
  add_length("--robot-height", a.robot_height,
             "Grid: height above the floor that must be free [unit of the cloud; default 1 m]");
  add_length("--robot-step", a.robot_step,
             "Grid: highest step of the floor, at least one cell [unit of the cloud; default 0.1 m]");
  app.add_option_function<std::string>(
         "--robot-slope",
         [&a](const std::string& text) {
           a.robot_slope_deg = number_in("--robot-slope", text, 1.0, 60.0, "degrees, 1 to 60");
         },
         "Grid: steepest slope of the floor [deg, 1 to 60; default 20]")
      ->type_name("DEG")
      ->group(kMap);
  app.add_flag("--map-units", a.map_units,
               "Accept lengths in map units if no scale is known: a robot that takes them for metres will collide")
      ->group(kMap);
}

bool is_map(const CloudOutput::Target& target) { return target.format->is_map; }

bool has_format(const CloudArguments& arguments, const char* name) {
  const std::vector<CloudOutput::Target> all = arguments.targets();
  return std::any_of(all.begin(), all.end(),
                     [name](const CloudOutput::Target& target) { return target.format->name == std::string(name); });
}

/// Rejects options that no output uses.
void check_map_options(const CloudArguments& a) {
  const auto has = [&](const char* name) { return has_format(a, name); };
  const MapArguments& map = a.map;
  if (a.resolution > 0.0 && a.has_map() && !has("las") && !has("potree")) {
    throw UsageError(
        "--resolution is the step of coordinates in LAS and Potree, of which none is written; the side of "
        "the cells of a map is --cell-size");
  }
  for (const auto& [is_given, option] : {std::pair{map.cell_size.has_value(), "--cell-size"},
                                         {map.least_rays.has_value(), "--least-rays"},
                                         {map.map_units, "--map-units"}}) {
    if (!is_given || a.has_map()) continue;
    throw UsageError(std::string(option) + " is for maps, of which none is written; expected -o with .bt, .ot or .pgm" +
                     (option == std::string("--cell-size") ? ", or --resolution for LAS and Potree" : ""));
  }
  for (const auto& [is_given, option] : {std::pair{map.robot_height.has_value(), "--robot-height"},
                                         {map.robot_step.has_value(), "--robot-step"},
                                         {map.robot_slope_deg.has_value(), "--robot-slope"}}) {
    if (!is_given || has("pgm")) continue;
    throw UsageError(std::string(option) +
                     " is for an occupancy grid, of which none is written; expected -o with .pgm");
  }
}

bool is_metre(const std::string& name) {
  return name == "m" || name == "metre" || name == "metres" || name == "meter" || name == "meters";
}

bool is_foot(const std::string& name) { return name == "ft" || name == "foot" || name == "feet"; }

}  // namespace

const std::filesystem::path* CloudArguments::first_cloud() const {
  const std::vector<CloudOutput::Target> all = targets();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!is_map(all[i])) return &paths[i];
  }
  return nullptr;
}

bool CloudArguments::has_map() const {
  const std::vector<CloudOutput::Target> all = targets();
  return std::any_of(all.begin(), all.end(), is_map);
}

std::vector<CloudOutput::Target> CloudArguments::targets() const {
  std::vector<CloudOutput::Target> targets;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const CloudFormat* format = i < formats.size() ? find_cloud_format(formats[i]) : cloud_format_of(paths[i]);
    // PLY without an extension.
    targets.push_back({format != nullptr ? format : &cloud_formats().front(), paths[i]});
  }
  return targets;
}

bool is_dataset(const CloudFormat& format) {
  return format.name == std::string("colmap") || format.name == std::string("nerfstudio");
}

bool CloudArguments::wants_depth() const {
  const std::vector<CloudOutput::Target> all = targets();
  return dataset_depth.is_wanted() && std::any_of(all.begin(), all.end(), [](const CloudOutput::Target& target) {
           return is_dataset(*target.format);
         });
}

std::string CloudArguments::text() const {
  std::string text;
  for (const std::filesystem::path& path : paths) text += (text.empty() ? "" : ", ") + path.string();
  return text;
}

std::string names_of_formats() {
  std::string text;
  for (const CloudFormat& format : cloud_formats()) text += (text.empty() ? "" : ", ") + std::string(format.name);
  return text;
}

void add_cloud_options(CLI::App& app, CloudArguments& arguments) {
  add_files(app, arguments);
  add_frame(app, arguments);
  add_map(app, arguments.map);
}

void check_cloud_arguments(const CloudArguments& arguments) {
  for (const std::string& name : arguments.formats) {
    if (find_cloud_format(name) == nullptr) {
      throw UsageError("--format is \"" + name + "\"; expected one of " + names_of_formats());
    }
  }
  if (!arguments.formats.empty() && arguments.formats.size() != arguments.paths.size()) {
    throw UsageError("--format is given " + std::to_string(arguments.formats.size()) + " and -o " +
                     std::to_string(arguments.paths.size()) + " times; expected one for each, or none");
  }
  for (std::size_t i = arguments.formats.size(); i < arguments.paths.size(); ++i) {
    const std::string extension = arguments.paths[i].extension().string();
    if (extension.empty() || cloud_format_of(arguments.paths[i]) != nullptr) continue;
    throw UsageError("--output " + arguments.paths[i].string() + ": no format has the extension " + extension +
                     "; expected --format with one of " + names_of_formats() + ", or the extension of one");
  }
  if (arguments.dataset_depth.is_wanted() && !arguments.wants_depth()) {
    throw UsageError(
        "--dataset-depth needs a dataset: add an output .colmap or .nerfstudio, or write depth maps of the run with "
        "--depth-maps");
  }
  if (!arguments.frame.align.empty() && arguments.frame.up) {
    throw UsageError("--align and --up exclude each other: --align determines the vertical axis");
  }
  check_map_options(arguments);
}

void check_map_units(const CloudArguments& arguments, const CloudUnit& unit) {
  if (unit.kind == CloudUnit::Kind::kMetres || !arguments.has_map()) return;
  if (!arguments.map.map_units) {
    throw UsageError(
        "a map for robots is written, but no scale is known: its lengths would be no metres; give --scale (1 if MAP is "
        "in metres), --align or, of convert, --length, or accept map units with --map-units");
  }
  for (const CloudOutput::Target& target : arguments.targets()) {
    if (target.format->name != std::string("pgm") || (arguments.map.robot_height && arguments.map.robot_step)) continue;
    throw UsageError("--map-units: the robot has no default size in map units; expected --robot-height and " +
                     std::string("--robot-step for ") + target.path.string());
  }
}

void set_map_options(CloudHeader& header, const CloudArguments& cloud, const std::vector<double>& ranges, int width) {
  const MapArguments& arguments = cloud.map;
  std::vector<double> in_file = ranges;
  for (double& range : in_file) range *= header.file_from_map.scale;
  header.cell_size = default_cell_size(std::move(in_file), width);
  if (arguments.least_rays) header.least_rays = *arguments.least_rays;
  if (arguments.robot_height) header.robot_height = *arguments.robot_height;
  if (arguments.robot_step) header.robot_step = *arguments.robot_step;
  if (arguments.robot_slope_deg) header.robot_slope_deg = *arguments.robot_slope_deg;
  header.map_units = arguments.map_units;
  if (has_format(cloud, "pgm")) header.cell_size = std::min(header.cell_size, header.robot_step);
  if (arguments.cell_size) header.cell_size = *arguments.cell_size;
}

std::string unit_of_lengths(const std::string& given, const CloudUnit& unit) {
  if (is_metre(given) || (given.empty() && unit.kind == CloudUnit::Kind::kMetres)) return "m";
  return is_foot(given) ? "ft" : given;
}

std::string unit_text(const CloudUnit& unit) {
  if (unit.kind == CloudUnit::Kind::kUnknown) return "not known";
  if (unit.kind == CloudUnit::Kind::kMap) return "map units (no scale is known)";
  return "metres" + (unit.by.empty() ? "" : ", by " + unit.by);
}

void check_unit(const char* option, const std::string& given, const CloudUnit& unit) {
  constexpr std::array kOthers{"km", "dm", "cm", "mm", "in", "inch", "inches", "yd", "yard", "yards"};
  const bool is_length =
      is_metre(given) || is_foot(given) || std::find(kOthers.begin(), kOthers.end(), given) != kOthers.end();
  if (!is_length || unit.kind == CloudUnit::Kind::kUnknown) return;
  if (unit.kind == CloudUnit::Kind::kMap) {
    throw UsageError(
        std::string(option) + " is \"" + given +
        "\", but the cloud has no scale: its lengths are in map units; scale it in `run` with --scale (1 if the "
        "map is in metres) or --align, or in `convert` with these or --length A B METRES");
  }
  if (is_metre(given)) return;
  throw UsageError(std::string(option) + " is \"" + given + "\", but the cloud is in " + unit_text(unit) +
                   "; omit the option");
}

workspace::RecordedCloud recorded_cloud(const DensifierOptions& options, const SlamMap& map) {
  const CloudHeader header = cloud_header_of(map, {}, options.advanced.init.range_margin);
  return {header.center, header.reach, how_made(options)};
}

nlohmann::ordered_json cloud_json(const CloudArguments& arguments, const CloudFrame& frame) {
  nlohmann::ordered_json json = frame_json(frame.file_from_map, frame.unit, arguments.amount);
  json["lengths"] = unit_text(frame.unit);
  if (frame.up_spread_deg) json["up_spread_deg"] = *frame.up_spread_deg;
  if (frame.residuals.empty()) return json;
  json["align"] = {{"rms", frame.residual_rms()}, {"max", frame.residual_max()}};
  for (const Residual& residual : frame.residuals) json["align"]["residuals"][residual.name] = residual.distance;
  return json;
}

std::filesystem::path scratch_folder(const std::filesystem::path& given, const CloudArguments& cloud) {
  if (!given.empty()) return given;
  const std::filesystem::path beside =
      cloud.paths.empty() ? std::filesystem::path() : cloud.paths.front().parent_path();
  return beside.empty() ? "." : beside;
}

std::filesystem::path scratch_folder(const Arguments& arguments) {
  return scratch_folder(arguments.scratch, arguments.cloud);
}

std::string read_wkt(const std::filesystem::path& path) {
  std::string wkt = read_whole_file(path);
  while (!wkt.empty() && std::isspace(static_cast<unsigned char>(wkt.back())) != 0) wkt.pop_back();
  return wkt;
}

namespace {

/// Millimetres, the default of nerfstudio, for clouds in metres that they suffice for; else the steps of --depth-maps.
double dataset_depth_scale(const SlamMap& map, double range_margin, const CloudFrame& frame) {
  constexpr double kMillimetre = 1e-3;
  const double scale = png_depth_scale(map, range_margin) * frame.file_from_map.scale;
  return frame.unit.kind == CloudUnit::Kind::kMetres && scale <= kMillimetre ? kMillimetre : scale;
}

}  // namespace

CloudHeader cloud_header(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                         const CloudFrame& frame) {
  CloudHeader header = cloud_header_of(map, frame.file_from_map, options.advanced.init.range_margin);
  header.unit = frame.unit;
  header.generator = version_text();
  header.comments = how_made(options);
  add_frame_comments(header.comments, frame.file_from_map, frame.unit, arguments.cloud.amount);
  header.resolution = arguments.cloud.resolution;
  header.double_positions = arguments.cloud.double_positions;
  if (!arguments.cloud.crs.empty()) header.wkt = read_wkt(arguments.cloud.crs);
  header.year = arguments.cloud.year;
  header.day_of_year = arguments.cloud.day_of_year;
  header.scratch = scratch_folder(arguments);
  header.dataset_points = arguments.cloud.dataset_points;
  header.dataset_depth = arguments.cloud.dataset_depth;
  header.dataset_depth.lens_distance = options.lens_distance;
  header.dataset_depth.png_scale = dataset_depth_scale(map, options.advanced.init.range_margin, frame);
  if (arguments.cloud.has_map()) {
    const int width = options.width > 0 ? options.width : map.cameras.empty() ? 0 : map.cameras[0].width;
    set_map_options(header, arguments.cloud, landmark_ranges(map), width);
  }
  return header;
}

}  // namespace pmsp::tool
