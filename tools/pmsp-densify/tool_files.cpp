// SPDX-License-Identifier: BSD-2-Clause
#include "tool_files.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <vector>

#include "depth_output.h"
#include "exit_code.h"
#include "export/atomic_folder.h"
#include "export/files.h"
#include "preview.h"
#include "report_photos.h"

namespace pmsp::tool {

namespace fs = std::filesystem;

std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

void write_if_changed(const fs::path& path, const std::string& text) {
  try {
    if (read_whole_file(path) == text) return;
  } catch (const IoError&) {  // no status
  }
  write_file(path, text);
}

std::vector<fs::path> entries_in(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    entries.push_back(it->path());
  }
  return entries;
}

std::string state_of(const fs::path& file) {
  std::error_code error;
  const auto time = fs::last_write_time(file, error).time_since_epoch().count();
  const bool is_there = !error;
  const auto size = is_there ? fs::file_size(file, error) : 0;  // unknown for folders
  return (is_there ? std::to_string(time) : "missing") + " " + (error ? "-" : std::to_string(size)) + "\n";
}

std::string state_of_files_in(const fs::path& folder) {
  std::vector<std::string> files;
  for (const fs::path& entry : entries_in(folder)) files.push_back(entry.filename().string() + " " + state_of(entry));
  std::sort(files.begin(), files.end());
  std::string state;
  for (const std::string& file : files) state += file;
  return state;
}

std::string state_of_map(const fs::path& map) {
  std::error_code ignored;
  return fs::is_directory(map, ignored) ? state_of_files_in(map) : state_of(map);
}

namespace {

struct Target {
  const char* option;
  fs::path path;
  bool (*writes)(const std::string& name);  ///< output files of a folder; nullptr for files

  bool is_file() const { return writes == nullptr; }
};

std::string text_of(const Target& target) { return std::string(target.option) + " " + target.path.string(); }

bool is_or_lies_in(const fs::path& place, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), place.begin(), place.end()).first == folder.end();
}

void check_file(const Arguments& arguments, const Target& target, bool may_replace) {
  std::error_code ignored;
  for (const fs::path& input : {arguments.map, arguments.video, arguments.mask, arguments.config, arguments.points,
                                arguments.image_list, arguments.camera_from_body, arguments.cloud.crs,
                                arguments.cloud.frame.align, arguments.cloud.frame.transform}) {
    if (!input.empty() && fs::equivalent(target.path, input, ignored)) {
      throw UsageError(text_of(target) + " would overwrite an input");
    }
  }
  if (!fs::exists(target.path, ignored)) return;
  if (!fs::is_regular_file(target.path, ignored)) {
    throw OutputError(target.path.string() + ": cannot be written, it exists and is no regular file");
  }
  if (!may_replace) {
    throw OutputError(target.path.string() + ": exists already; --force overwrites it, or give another " +
                      target.option);
  }
}

void check_folder(const Arguments& arguments, const Target& target, bool may_replace) {
  if (!arguments.images.empty() && place_of(target.path) == place_of(arguments.images)) {
    throw UsageError(text_of(target) + " is the directory of the images; give another one");
  }
  for (const fs::path& depth : {arguments.prior_depth, arguments.external_depths}) {
    if (depth.empty() || place_of(target.path) != place_of(depth)) continue;
    throw UsageError(text_of(target) + " is the directory of the depth images; give another one");
  }
  std::error_code error;
  if (!fs::exists(target.path, error)) return;
  if (!fs::is_directory(target.path, error)) throw OutputError(target.path.string() + ": exists and is no directory");
  if (!AtomicFolder::is_free(target.path) && !may_replace) {
    throw OutputError(target.path.string() + ": is not empty; --force writes into it, or give another " +
                      target.option);
  }
}

/// True if writing the file `a` and `b` would destroy one of them.
bool file_collides(const Target& a, const Target& b) {
  const fs::path place = place_of(a.path);
  if (is_or_lies_in(place_of(b.path), place)) return true;
  return !b.is_file() && place.parent_path() == place_of(b.path) && b.writes(place.filename().string());
}

void check_pair(const Target& a, const Target& b) {
  if ((a.is_file() && file_collides(a, b)) || (b.is_file() && file_collides(b, a))) {
    throw UsageError(text_of(a) + " and " + text_of(b) + " would overwrite each other; give different names");
  }
  if (a.writes == b.writes && place_of(a.path) == place_of(b.path)) {
    throw UsageError(text_of(a) + " and " + text_of(b) +
                     " are the same directory, and their files have the same names; give different ones");
  }
}

/// `info` without images concerns the map only, and writes nothing but a plan.
bool is_of_other_verb(const Arguments& arguments, const Target& target) {
  const bool is_about_map = arguments.verb == Verb::kInfo && arguments.images.empty() && arguments.video.empty();
  return is_about_map && std::string(target.option) != "--plan";
}

bool is_workspace_file(const std::string& name) {
  return name == "workspace.json" || name == "begun.json" || name == "lock" || name == "planes" || name == "points" ||
         name == "image_records" || name == "shards";
}

std::vector<Target> targets_of(const Arguments& arguments) {
  std::vector<Target> targets;
  for (const CloudOutput::Target& cloud : arguments.cloud.targets()) {
    const Target target{"--output", cloud.path, cloud.format->writes};
    if (is_of_other_verb(arguments, target)) continue;
    targets.push_back(target);
    if (cloud.format->beside == nullptr) continue;
    for (const fs::path& path : cloud.format->beside(cloud.path)) targets.push_back({"--output", path, nullptr});
  }
  for (const Target& target : {Target{"--stats", arguments.stats, nullptr},
                               {"--depth-maps", arguments.depth_maps, is_depth_map_file},
                               {"--raw-depth-maps", arguments.raw_depth_maps, is_depth_map_file},
                               {"--preview", arguments.preview, is_preview_file},
                               {"--report", arguments.report.path, nullptr},
                               {"--report-photos", arguments.report.photos, is_photo_file},
                               {"--plan", arguments.plan, nullptr}}) {
    if (!target.path.empty() && !is_of_other_verb(arguments, target)) targets.push_back(target);
  }
  return targets;
}

/// Rejects targets with file names of the workspace, or in its subfolders.
void check_beside_workspace(const Arguments& arguments, const Target& target) {
  if (arguments.workspace.empty()) return;
  check_pair({"--workspace", arguments.workspace, is_workspace_file}, target);
  const fs::path folder = place_of(arguments.workspace);
  for (const char* inner : {"planes", "points", "image_records", "shards"}) {
    if (!is_or_lies_in(place_of(target.path), folder / inner)) continue;
    throw UsageError(text_of(target) + " is inside --workspace; give another path");
  }
}

}  // namespace

fs::path place_of(const fs::path& path) {
  std::error_code ignored;
  const fs::path place = fs::weakly_canonical(fs::absolute(end_of_links(path)), ignored);
  return place.has_filename() ? place : place.parent_path();  // "folder/" to "folder"
}

std::vector<fs::path> target_paths(const Arguments& arguments) {
  std::vector<fs::path> paths;
  for (const Target& target : targets_of(arguments)) paths.push_back(target.path);
  return paths;
}

void check_names(const Arguments& arguments) {
  const std::vector<Target> targets = targets_of(arguments);
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (targets[i].path == "-") {
      throw UsageError(text_of(targets[i]) + ": results cannot be written to standard output; give the name of a " +
                       (targets[i].is_file() ? "file" : "folder"));
    }
    for (std::size_t k = 0; k < i; ++k) check_pair(targets[k], targets[i]);
    check_beside_workspace(arguments, targets[i]);
  }
}

void check_targets(const Arguments& arguments, const std::vector<fs::path>& own) {
  check_names(arguments);
  for (const Target& target : targets_of(arguments)) {
    const fs::path place = place_of(target.path);
    const bool may_replace = arguments.force || std::any_of(own.begin(), own.end(), [&](const fs::path& path) {
                               return place_of(path) == place;
                             });
    if (target.is_file()) {
      check_file(arguments, target, may_replace);
    } else {
      check_folder(arguments, target, may_replace);
    }
  }
}

std::vector<fs::path> recorded_outputs(const Arguments& arguments, const workspace::Workspace& workspace) {
  std::vector<fs::path> paths;
  for (const std::string& output : workspace.record().outputs) paths.push_back(arguments.workspace / output);
  return paths;
}

}  // namespace pmsp::tool
