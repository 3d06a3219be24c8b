// SPDX-License-Identifier: BSD-2-Clause
#include "batch_manifest.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <exception>
#include <iostream>
#include <iterator>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "batch_arguments.h"
#include "export/files.h"
#include "io/image_naming.h"
#include "options.h"
#include "pmsp/error.h"
#include "tool_files.h"
#include "util/text.h"

namespace pmsp::tool {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;  // keeps the order of options

constexpr std::array kManifestColumns{"name", "map", "images", "video", "mask", "options"};
/// Text fields of a mission by key.
constexpr std::pair<const char*, std::string Mission::*> kTexts[] = {
    {"name", &Mission::name},   {"map", &Mission::map},   {"images", &Mission::images},
    {"video", &Mission::video}, {"mask", &Mission::mask}, {"error", &Mission::error}};

constexpr const char* kNameCharacters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
constexpr std::size_t kMaxName = 200;
constexpr const char* kRecord = "batch.json";

struct ManifestLine {
  std::size_t number = 0;
  std::string text;
};

std::string stripped(const std::string& text) { return trimmed(text, " \t\r"); }

/// Lines without blank ones and comments.
std::vector<ManifestLine> lines_of(std::string text) {
  if (text.rfind("\xEF\xBB\xBF", 0) == 0) text.erase(0, 3);
  std::vector<ManifestLine> lines;
  std::size_t number = 1;
  for (std::size_t begin = 0; begin < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string line = text.substr(begin, end - begin);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    const std::string content = stripped(line);
    if (!content.empty() && content[0] != '#') lines.push_back({number, std::move(line)});
    begin = end + 1;
  }
  return lines;
}

void check_name(const std::string& name) {
  if (name.find_first_not_of(kNameCharacters) != std::string::npos || name[0] == '.' || name.size() > kMaxName) {
    throw InvalidInput(
        "name \"" + name +
        "\" is no valid directory name; expected up to 200 of A-Z a-z 0-9 . _ -, not beginning with a dot");
  }
  for (const char* taken : {"lock", "batch.json", "missions.csv", "index.html", "batch.sbatch"}) {
    if (name == taken) throw InvalidInput("name \"" + name + "\" is reserved by the batch");
  }
}

/// Removes the extension and common trailing parts: "a/hall" for a/hall/map.msg, a/hall/sparse/0 and
/// a/hall/reconstruction.json.
fs::path title_of_map(const fs::path& map) {
  fs::path title = map.has_filename() ? map : map.parent_path();
  title.replace_extension();
  for (;;) {
    const std::string last = title.filename().string();
    const fs::path folder = title.parent_path();
    const bool is_component =
        folder.filename() == "sparse" && last.find_first_not_of("0123456789") == std::string::npos;
    const bool is_shared = is_component || last == "map" || last == "sparse" || last == "reconstruction";
    const fs::path parent = folder.filename();
    if (!is_shared || parent.empty() || parent == "." || parent == "..") return title;
    title = folder;
  }
}

std::string name_of_map(const fs::path& map) {
  std::string text = title_of_map(map).filename().string();
  for (char& c : text) {
    if (std::string(kNameCharacters).find(c) == std::string::npos) c = '_';
  }
  if (!text.empty() && text[0] == '.') text[0] = '_';
  return text;
}

std::string& column(Mission& mission, const std::string& key) {
  return mission.*
         std::find_if(std::begin(kTexts), std::end(kTexts), [&](const auto& it) { return key == it.first; })->second;
}

bool is_column(const std::string& key) {
  return std::find(kManifestColumns.begin(), kManifestColumns.end(), key) != kManifestColumns.end();
}

/// Converts options in the format of --config to arguments: {"fusion": {"window": 7}} to --fusion-window=7.
void words_of_object(const Json& object, const std::string& prefix, std::vector<std::string>& words) {
  for (const auto& [key, value] : object.items()) {
    const std::string name = prefix + with_hyphens(key);
    if (value.is_object()) {
      words_of_object(value, name + "-", words);
    } else if (value.is_string() || value.is_number() || value.is_boolean()) {
      words.push_back(name + "=" + (value.is_string() ? value.get<std::string>() : value.dump()));
    } else {
      throw InvalidInput("options: " + key + " is " + value.dump() + "; expected a number, a string, true or false");
    }
  }
}

void check(const Mission& mission) {
  if (mission.map.empty()) throw InvalidInput("\"map\" is missing");
  if (mission.images.empty() == mission.video.empty()) {
    throw InvalidInput(mission.images.empty() ? "the images are missing; give \"images\" or \"video\""
                                              : "\"images\" and \"video\" exclude each other");
  }
}

/// Sets fields from a JSON line in order; throws at the first invalid one.
void read_object(const std::string& line, const fs::path& folder, Mission& mission) {
  Json object;
  try {
    object = Json::parse(line);
  } catch (const Json::parse_error& error) {
    throw InvalidInput("is no JSON, column " + std::to_string(error.byte) + "; expected an object in one line, {...}");
  }
  if (!object.is_object()) throw InvalidInput("is no JSON object, {...}");
  std::string mistake;
  for (const auto& [key, value] : object.items()) {
    if (!is_column(key)) {
      mistake = "there is no key \"" + key + "\"" + suggestion(key, {kManifestColumns.begin(), kManifestColumns.end()});
    } else if (key == "options" ? !value.is_object() : !value.is_string()) {
      mistake = "\"" + key + "\" is " + value.dump() + "; expected " + (key == "options" ? "an object" : "a string");
    } else if (key != "options") {
      column(mission, key) = value.get<std::string>();
    }
  }
  if (!mistake.empty()) throw InvalidInput(mistake);
  std::vector<std::string> words;
  if (object.contains("options")) words_of_object(object["options"], "--", words);
  mission.options = mission_options(std::move(words), folder);
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  for (std::size_t tab = line.find('\t'); tab != std::string::npos; tab = line.find('\t', begin)) {
    cells.push_back(stripped(line.substr(begin, tab - begin)));
    begin = tab + 1;
  }
  cells.push_back(stripped(line.substr(begin)));
  return cells;
}

std::vector<std::string> columns_of(const ManifestLine& head, const std::string& path) {
  std::vector<std::string> columns = cells_of(head.text);
  const std::string where = path + ": line " + std::to_string(head.number) + ": ";
  for (auto it = columns.begin(); it != columns.end(); ++it) {
    if (!is_column(*it)) {
      throw InvalidInput(where + "there is no column \"" + *it + "\"; expected name, map, images, video, mask, " +
                         "options, with tabs between them, or JSON lines");
    }
    if (std::find(columns.begin(), it, *it) != it) throw InvalidInput(where + "two columns are named " + *it);
  }
  return columns;
}

void read_row(const std::string& line, const std::vector<std::string>& columns, const fs::path& folder,
              Mission& mission) {
  const std::vector<std::string> cells = cells_of(line);
  std::string words;
  for (std::size_t i = 0; i < std::min(cells.size(), columns.size()); ++i) {
    (columns[i] == "options" ? words : column(mission, columns[i])) = cells[i];
  }
  if (cells.size() > columns.size()) {
    throw InvalidInput("has " + std::to_string(cells.size()) + " cells; expected up to " +
                       std::to_string(columns.size()));
  }
  mission.options = mission_options(split_words(words), folder);
}

void name_missions(std::vector<Mission>& missions, const std::string& path) {
  std::map<std::string, std::size_t> lines;
  for (Mission& mission : missions) {
    const std::string line = "line " + std::to_string(mission.line);
    try {
      if (mission.name.empty()) mission.name = name_of_map(mission.map);
      if (!mission.name.empty()) check_name(mission.name);
    } catch (const InvalidInput& error) {
      mission.name.clear();
      mission.error = path + ": " + line + ": " + error.what();
    }
    if (mission.name.empty()) mission.name = "(" + line + ")";
    const auto [other, is_new] = lines.emplace(mission.name, mission.line);
    if (is_new) continue;
    throw InvalidInput(path + ": lines " + std::to_string(other->second) + " and " + std::to_string(mission.line) +
                       " are both named \"" + mission.name + "\"; give different \"name\"s");
  }
}

std::string text_of_manifest(const std::string& path) {
  if (path != "-") return read_whole_file(path);
  return {std::istreambuf_iterator<char>(std::cin), std::istreambuf_iterator<char>()};
}

Json json_of(const Mission& mission) {
  Json json{{"line", mission.line}};
  for (const auto& [key, text] : kTexts) {
    if (!(mission.*text).empty()) json[key] = mission.*text;
  }
  json["options"] = mission.options;
  return json;
}

Mission mission_from(const Json& json) {
  Mission mission;
  mission.line = json.at("line").get<std::size_t>();
  for (const auto& [key, text] : kTexts) mission.*text = json.value(key, "");
  mission.options = json.at("options").get<std::vector<std::string>>();
  if (mission.error.empty()) check_name(mission.name);
  return mission;
}

/// As options, for `difference`.
std::vector<std::string> words_of_mission(const Mission& mission) {
  std::vector<std::string> words;
  for (const auto& [key, text] : kTexts) {
    if (text != &Mission::name && text != &Mission::error && !(mission.*text).empty()) {
      words.push_back(std::string(key) + "=" + mission.*text);
    }
  }
  words.insert(words.end(), mission.options.begin(), mission.options.end());
  return words;
}

}  // namespace

Manifest read_manifest(const std::string& path) {
  const std::vector<ManifestLine> lines = lines_of(text_of_manifest(path));
  Manifest manifest;
  manifest.path = path;
  manifest.folder = (fs::current_path() / (path == "-" ? fs::path() : fs::path(path).parent_path())).lexically_normal();
  const bool is_table = !lines.empty() && stripped(lines.front().text)[0] != '{';
  std::vector<std::string> columns;
  if (is_table) columns = columns_of(lines.front(), path);
  for (std::size_t i = is_table ? 1 : 0; i < lines.size(); ++i) {
    Mission mission;
    mission.line = lines[i].number;
    try {
      if (is_table) {
        read_row(lines[i].text, columns, manifest.folder, mission);
      } else {
        read_object(lines[i].text, manifest.folder, mission);
      }
      check(mission);
    } catch (const std::exception& error) {
      mission.error = path + ": line " + std::to_string(mission.line) + ": " + error.what();
    }
    manifest.missions.push_back(std::move(mission));
  }
  if (manifest.missions.empty()) throw InvalidInput(path + ": contains no mission; expected one per line");
  name_missions(manifest.missions, path);
  return manifest;
}

std::optional<Manifest> read_record(const fs::path& folder) {
  const fs::path path = folder / kRecord;
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  const std::string text = read_whole_file(path);
  try {
    const Json json = Json::parse(text);
    Manifest record;
    record.path = json.at("manifest").get<std::string>();
    record.folder = json.at("folder").get<std::string>();
    record.options = json.at("options").get<std::vector<std::string>>();
    for (const Json& mission : json.at("missions")) {
      record.missions.push_back(mission_from(mission));
    }
    return record;
  } catch (const std::exception& error) {
    throw InvalidInput(path.string() + ": is no record of a batch (" + error.what() +
                       "); move it away and give MANIFEST and the options again");
  }
}

void write_record(const fs::path& folder, const Manifest& record) {
  Json json{{"generator", version_text()},
            {"manifest", record.path},
            {"folder", record.folder.string()},
            {"options", record.options},
            {"missions", Json::array()}};
  for (const Mission& mission : record.missions) json["missions"].push_back(json_of(mission));
  write_if_changed(folder / kRecord, json_text(json));
}

std::string line_difference(const Mission& recorded, const Mission& given) {
  const std::vector<std::string> before = words_of_mission(recorded), now = words_of_mission(given);
  const std::string added = difference(before, now);
  if (!added.empty()) return added;
  for (const std::string& word : before) {
    if (value_in(now, name_of_option(word)).empty()) return "recorded " + word + ", given none";
  }
  return "";
}

namespace {

bool has_extension(const fs::path& path, const std::set<std::string>& extensions) {
  return extensions.count(lower_case(path.extension().string())) > 0;
}

bool is_map(const fs::path& path) {
  return has_extension(path, {".msg", ".db"}) || path.filename() == "reconstruction.json";  // OpenSfM
}
bool is_video(const fs::path& path) {
  return has_extension(path, {".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v", ".insv", ".360"});
}

bool holds_images(const fs::path& folder) {
  const std::vector<fs::path> entries = entries_in(folder);
  return std::any_of(entries.begin(), entries.end(), io::is_image_name);
}

bool holds_image_folder(const fs::path& folder) {
  const std::vector<fs::path> entries = entries_in(folder);
  return std::any_of(entries.begin(), entries.end(), [](const fs::path& entry) {
    std::error_code ignored;
    return fs::is_directory(entry, ignored) && holds_images(entry);
  });
}

/// COLMAP model.
bool is_model(const fs::path& folder) {
  const auto has = [&](const char* name) {
    std::error_code ignored;
    return fs::exists(folder / (std::string(name) + ".bin"), ignored) ||
           fs::exists(folder / (std::string(name) + ".txt"), ignored);
  };
  return has("cameras") && has("images");
}
/// The only model of a COLMAP folder "sparse" with models 0, 1, ...; the folder itself if there are several.
fs::path map_in(const fs::path& sparse) {
  fs::path map;
  for (const fs::path& entry : entries_in(sparse)) {
    if (is_model(entry)) map = map.empty() ? entry : sparse;
  }
  return map;
}

/// Visible entries of a folder, by name.
struct Contents {
  std::vector<fs::path> maps, image_folders, videos, folders;
  fs::path mask;
};

Contents contents_of(const fs::path& folder) {
  Contents contents;
  std::vector<fs::path> entries = entries_in(folder);
  std::sort(entries.begin(), entries.end());
  if (is_model(folder)) contents.maps.push_back(folder);
  std::error_code error;
  for (const fs::path& entry : entries) {
    if (entry.filename().string()[0] == '.') continue;
    if (fs::is_directory(entry, error)) {
      const fs::path map = is_model(entry) ? entry : entry.filename() == "sparse" ? map_in(entry) : fs::path();
      if (!map.empty() && !holds_image_folder(map)) {
        contents.maps.push_back(map);
        continue;
      }
      if (!fs::is_symlink(entry, error)) contents.folders.push_back(entry);  // links may be circular
      if (entry.filename() != "masks" && holds_images(entry)) contents.image_folders.push_back(entry);
    } else if (fs::is_regular_file(entry, error)) {
      if (is_map(entry)) contents.maps.push_back(entry);
      if (is_video(entry)) contents.videos.push_back(entry);
      if (entry.filename() == "mask.png") contents.mask = entry;
    }
  }
  const auto is_of_colmap = [&](const fs::path& map) { return map.filename() == "database.db"; };
  if (std::any_of(contents.maps.begin(), contents.maps.end(), is_model)) {
    contents.maps.erase(std::remove_if(contents.maps.begin(), contents.maps.end(), is_of_colmap), contents.maps.end());
  }
  return contents;
}

/// Name of a folder; name of a file without extension.
fs::path title_of(const fs::path& path) { return is_map(path) || is_video(path) ? path.stem() : path.filename(); }

fs::path titled(const std::vector<fs::path>& paths, const fs::path& title) {
  const auto found =
      std::find_if(paths.begin(), paths.end(), [&](const fs::path& path) { return title_of(path) == title; });
  return found != paths.end() ? *found : fs::path();
}

/// The only path whose name matches no map.
fs::path only_other(const std::vector<fs::path>& paths, const std::vector<fs::path>& maps) {
  fs::path other;
  for (const fs::path& path : paths) {
    if (!titled(maps, title_of(path)).empty()) continue;
    if (!other.empty()) return {};
    other = path;
  }
  return other;
}

fs::path images_beside(const fs::path& map, const Contents& contents) {
  for (const fs::path& title : {map.stem(), fs::path("images"), fs::path("keyframes"), fs::path("frames")}) {
    fs::path folder = titled(contents.image_folders, title);
    if (!folder.empty()) return folder;
  }
  return only_other(contents.image_folders, contents.maps);
}

fs::path video_beside(const fs::path& map, const Contents& contents) {
  fs::path video = titled(contents.videos, map.stem());
  return !video.empty() ? video : only_other(contents.videos, contents.maps);
}

class Scanner {
 public:
  explicit Scanner(const fs::path& root) : root_(root) { look_into(root); }
  Scan take() { return std::move(scan_); }

 private:
  void look_into(const fs::path& folder) {
    const Contents contents = contents_of(folder);
    for (const fs::path& map : contents.maps) add(map, contents);
    for (const fs::path& inner : contents.folders) look_into(inner);
  }

  void add(const fs::path& map, const Contents& contents) {
    const fs::path images = images_beside(map, contents);
    const fs::path video = images.empty() ? video_beside(map, contents) : fs::path();
    if (images.empty() && video.empty()) {
      scan_.without_images.push_back(map);
      return;
    }
    nlohmann::ordered_json mission{{"name", unique_name(map)}, {"map", map.string()}};
    mission[images.empty() ? "video" : "images"] = (images.empty() ? video : images).string();
    if (!contents.mask.empty()) mission["mask"] = contents.mask.string();
    scan_.missions.push_back(mission);
  }

  /// Returns "site-flight" for "site/flight/map.msg", "site-old" for "site/old.msg".
  std::string unique_name(const fs::path& map) {
    std::string name = title_of_map(map.lexically_relative(root_)).string();
    if (name == ".") name = (fs::absolute(root_) / ".").lexically_normal().parent_path().filename().string();
    for (char& c : name) {
      const auto byte = static_cast<unsigned char>(c);
      if (c == '/') c = '-';
      if (byte >= 128 || (std::isalnum(byte) == 0 && c != '.' && c != '_' && c != '-')) c = '_';
    }
    const std::string first = name;
    for (int number = 2; !names_.insert(name).second; ++number) name = first + "-" + std::to_string(number);
    return name;
  }

  fs::path root_;
  std::set<std::string> names_;
  Scan scan_;
};

}  // namespace

Scan scan_for_missions(const fs::path& folder) {
  std::error_code error;
  const fs::directory_iterator readable(folder, error);
  if (error) throw IoError(folder.string() + ": the directory cannot be listed: " + error.message());
  return Scanner(folder).take();
}

}  // namespace pmsp::tool
