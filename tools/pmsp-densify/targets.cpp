// SPDX-License-Identifier: BSD-2-Clause
#include "targets.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <vector>

#include "depth_output.h"
#include "exit_code.h"
#include "preview.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

struct Target {
  const char* option;
  fs::path path;
  bool (*writes)(const std::string& name);  ///< files of a folder that the run writes; nullptr for a file

  bool is_file() const { return writes == nullptr; }
};

std::string text_of(const Target& target) { return std::string(target.option) + " " + target.path.string(); }

/// One spelling for each place, whether something is there or not.
fs::path place_of(const fs::path& path) {
  std::error_code ignored;
  const fs::path place = fs::weakly_canonical(fs::absolute(path), ignored);
  return place.has_filename() ? place : place.parent_path();  // "folder/" is "folder"
}

bool is_or_lies_in(const fs::path& place, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), place.begin(), place.end()).first == folder.end();
}

void check_file(const Arguments& arguments, const Target& target) {
  std::error_code ignored;
  for (const fs::path& input : {arguments.map, arguments.video, arguments.mask, arguments.config}) {
    if (!input.empty() && fs::equivalent(target.path, input, ignored)) {
      throw UsageError(text_of(target) + " would overwrite an input");
    }
  }
  if (!fs::exists(target.path, ignored)) return;
  if (!fs::is_regular_file(target.path, ignored)) {
    throw OutputError(target.path.string() + ": cannot be written, it exists and is no ordinary file");
  }
  if (!arguments.force) {
    throw OutputError(target.path.string() + ": exists already; --force overwrites it, or give another " +
                      target.option);
  }
}

void check_folder(const Arguments& arguments, const Target& target) {
  if (!arguments.images.empty() && place_of(target.path) == place_of(arguments.images)) {
    throw UsageError(text_of(target) + " is the folder of the images; give one of its own");
  }
  std::error_code error;
  if (!fs::exists(target.path, error)) return;
  if (!fs::is_directory(target.path, error)) throw OutputError(target.path.string() + ": exists and is no folder");
  if (!fs::is_empty(target.path, error) && !arguments.force) {
    throw OutputError(target.path.string() + ": is not empty; --force writes into it, or give another " +
                      target.option);
  }
}

/// Whether writing `a`, a file, and `b` would destroy one of them.
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
    throw UsageError(text_of(a) + " and " + text_of(b) + " name one folder; their files have the same names");
  }
}

/// The cloud has a name by default, which means nothing where none is written.
bool is_of_other_verb(const Arguments& arguments, const Target& target) {
  return arguments.verb == Verb::kInfo && std::string(target.option) != "--plan";
}

}  // namespace

void check_targets(const Arguments& arguments) {
  std::vector<Target> targets;
  for (const Target& target : {Target{"--output", arguments.output, nullptr},
                               {"--stats", arguments.stats, nullptr},
                               {"--depth-maps", arguments.depth_maps, is_depth_map_file},
                               {"--raw-depth-maps", arguments.raw_depth_maps, is_depth_map_file},
                               {"--preview", arguments.preview, is_preview_file},
                               {"--plan", arguments.plan, nullptr}}) {
    if (target.path.empty() || is_of_other_verb(arguments, target)) continue;
    for (const Target& other : targets) check_pair(other, target);
    targets.push_back(target);
  }
  for (const Target& target : targets) {
    if (target.is_file()) {
      check_file(arguments, target);
    } else {
      check_folder(arguments, target);
    }
  }
}

}  // namespace pmsp::tool
