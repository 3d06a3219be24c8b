// SPDX-License-Identifier: BSD-2-Clause
#include "depth_folder.h"

#include <string>
#include <utility>

#include "json_input.h"
#include "pmsp/error.h"
#include "pmsp/io/depth_io.h"

namespace pmsp::io {
namespace {

namespace fs = std::filesystem;
using map_detail::JsonValue;

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

/// The file in the folder that a key of an entry names; empty where it names none.
fs::path named_file(const fs::path& folder, const JsonValue& entry, const char* key) {
  if (!entry.has(key)) return {};
  const std::string& name = entry.at(key).text();
  if (name.empty() || name[0] == '.' || fs::path(name).filename() != name) {
    entry.at(key).refuse("the name of a file in the same folder");
  }
  return folder / name;
}

}  // namespace

DepthFolder::DepthFolder(const fs::path& folder, const fs::path& images) : folder_(folder), images_(images) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw IoError(folder.string() + ": there is no such folder of depth images");
  const fs::path index = folder / "index.json";
  indexed_ = is_file(index);
  if (!indexed_) return;
  const nlohmann::json json = map_detail::read_json(index);
  const JsonValue root(json, index);
  if (root.has("png_scale")) png_scale_ = root.at("png_scale").number();
  if (!(png_scale_ > 0.0)) root.at("png_scale").refuse("a number > 0");
  root.at("maps").each_element([&](const JsonValue& map) {
    fs::path file;
    for (const char* key : {"depth", "exr", "depth_png"}) {
      if (file.empty()) file = named_file(folder, map, key);
    }
    if (file.empty()) map.refuse("the name of a file as depth, exr or depth_png");
    files_[map.at("keyframe_id").integer()] = std::move(file);
  });
}

fs::path DepthFolder::file_for(std::int64_t keyframe_id, const fs::path& image) const {
  if (indexed_) {
    const auto found = files_.find(keyframe_id);
    return found == files_.end() ? fs::path() : found->second;
  }
  const fs::path relative = images_.empty() ? fs::path() : image.lexically_relative(images_);
  const fs::path name = relative.empty() || *relative.begin() == ".." ? image.filename() : relative;
  std::error_code ignored;
  for (const char* extension : {".pfm", ".exr", ".npy", ".png"}) {
    const fs::path file = folder_ / fs::path(name).replace_extension(extension);
    // Depth that lies among the images must not be the image itself.
    if (is_file(file) && !fs::equivalent(file, image, ignored)) return file;
  }
  return {};
}

Image<float> DepthFolder::read(const fs::path& file) const {
  const std::string extension = file.extension().string();
  if (extension == ".pfm") return read_pfm(file);
  if (extension == ".exr") return read_exr_depth(file);
  if (extension == ".npy") return read_npy(file);
  return read_png16(file, png_scale_);
}

}  // namespace pmsp::io
