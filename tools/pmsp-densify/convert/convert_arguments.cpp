// SPDX-License-Identifier: BSD-2-Clause
#include "convert_arguments.h"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "arguments.h"
#include "command_line.h"
#include "exit_code.h"
#include "numbers.h"
#include "targets.h"
#include "workspace/workspace_cloud.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAbout =
    "Converts a cloud (PLY, LAS or Potree) or a workspace (run --workspace) to another format, frame, unit or amount,\n"
    "without images. --align, --up, --transform and --scale apply to the frame of IN instead of that of the map, in\n"
    "this order; the header of OUT contains the whole transform from the map.\n";

constexpr const char* kMore =
    "Examples:\n"
    "  pmsp-densify convert cloud.ply -o cloud.las\n"
    "  pmsp-densify convert cloud.ply -o metres.ply --length 0.1,-0.2,1.5 0.1,0.9,1.5 2.01\n"
    "  pmsp-densify convert work/ -o up.ply -o up.potree --up --scale 1.8\n"
    "  pmsp-densify convert cloud.ply -o part.las --crop -5,-5,0,5,5,3 --voxel 0.05";

std::optional<Eigen::Vector3d> point_from(const std::string& text) {
  Eigen::Vector3d point;
  std::size_t at = 0;
  for (int i = 0; i < 3; ++i) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const auto number = at <= end ? number_from<double>(text.substr(at, end - at)) : std::nullopt;
    if (!number || std::abs(*number) > 1e12) return std::nullopt;
    point[i] = *number;
    at = end + 1;
  }
  return at > text.size() ? std::optional<Eigen::Vector3d>(point) : std::nullopt;
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
    const std::string name = target.format->name;
    if (name != "colmap" && name != "nerfstudio") continue;
    throw UsageError("--output " + target.path.string() + ": " + name +
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

}  // namespace

std::optional<ConvertArguments> parse_convert_arguments(int argc, const char* const* argv) {
  ConvertArguments a;
  a.cloud.paths.clear();
  std::vector<std::string> length;
  CLI::App app(kAbout, "pmsp-densify convert");
  set_up_verb(app, kMore);
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
          "Result; may be given several times. The format follows from the extension: .ply, .las or .potree, a "
          "folder");
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

}  // namespace pmsp::tool
