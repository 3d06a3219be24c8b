// SPDX-License-Identifier: BSD-2-Clause
#include "batch_scan.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <system_error>

#include "batch_manifest.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

bool has_extension(const fs::path& path, const std::set<std::string>& extensions) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extensions.count(extension) > 0;
}

bool is_map(const fs::path& path) {
  return has_extension(path, {".msg", ".db"}) || path.filename() == "reconstruction.json";  // OpenSfM
}
bool is_video(const fs::path& path) {
  return has_extension(path, {".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v", ".insv", ".360"});
}
bool is_image(const fs::path& path) {
  return has_extension(path, {".jpg", ".jpeg", ".jpe", ".png", ".tif", ".tiff", ".bmp", ".webp"});
}

bool holds_images(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (is_image(it->path()) && it->path().filename().string()[0] != '.') return true;
  }
  return false;
}

bool holds_image_folder(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (fs::is_directory(it->path(), error) && holds_images(it->path())) return true;
  }
  return false;
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
  std::error_code error;
  for (fs::directory_iterator it(sparse, error), end; !error && it != end; it.increment(error)) {
    if (is_model(it->path())) map = map.empty() ? it->path() : sparse;
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
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (it->path().filename().string()[0] != '.') entries.push_back(it->path());
  }
  std::sort(entries.begin(), entries.end());
  if (is_model(folder)) contents.maps.push_back(folder);
  for (const fs::path& entry : entries) {
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
