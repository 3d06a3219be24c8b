// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/depth.h"

#include <algorithm>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "export/files.h"
#include "json_input.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

namespace fs = std::filesystem;

/// Path of the file named by a key of an entry; empty = none.
fs::path named_file(const fs::path& folder, const JsonValue& entry, const char* key) {
  if (!entry.has(key)) return {};
  const std::string& name = entry.at(key).text();
  if (name.empty() || name[0] == '.' || fs::path(name).filename() != name) {
    entry.at(key).refuse("the name of a file in the same directory");
  }
  return folder / name;
}

}  // namespace

DepthFolder::DepthFolder(const fs::path& folder, const fs::path& images) : folder_(folder), images_(images) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw IoError(folder.string() + ": there is no such directory of depth images");
  const fs::path index = folder / "index.json";
  indexed_ = is_file(index);
  if (!indexed_) return;
  const nlohmann::json json = read_json(index);
  const JsonValue root(json, index);
  if (root.has("png_scale")) png_scale_ = root.at("png_scale").number();
  if (!(png_scale_ > 0.0)) root.at("png_scale").refuse("a number > 0");
  if (root.has("kind")) kind_ = root.at("kind").text();
  if (root.has("lens_distance")) lens_distance_ = root.at("lens_distance").number();
  root.at("maps").each_element([&](const JsonValue& map) {
    const auto first_of = [&](std::initializer_list<const char*> keys) {
      fs::path file;
      for (const char* key : keys) {
        if (file.empty()) file = named_file(folder, map, key);
      }
      return file;
    };
    Files files{first_of({"depth", "exr", "depth_png"}), first_of({"normal", "exr", "normal_png"}),
                first_of({"confidence", "exr", "confidence_png"})};
    if (files.depth.empty()) map.refuse("the name of a file as depth, exr or depth_png");
    files_[map.at("keyframe_id").integer()] = std::move(files);
  });
}

const DepthFolder::Files* DepthFolder::files_of(std::int64_t keyframe_id) const {
  const auto found = files_.find(keyframe_id);
  return found == files_.end() ? nullptr : &found->second;
}

fs::path DepthFolder::file_for(std::int64_t keyframe_id, const fs::path& image) const {
  if (indexed_) {
    const Files* const files = files_of(keyframe_id);
    return files == nullptr ? fs::path() : files->depth;
  }
  const fs::path relative = images_.empty() ? fs::path() : image.lexically_relative(images_);
  const fs::path name = relative.empty() || *relative.begin() == ".." ? image.filename() : relative;
  std::error_code ignored;
  for (const char* extension : {".pfm", ".exr", ".npy", ".png"}) {
    const fs::path file = folder_ / fs::path(name).replace_extension(extension);
    // Depth beside the images must not be the image itself.
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

Image<Eigen::Vector3f> DepthFolder::read_normals(std::int64_t keyframe_id) const {
  const Files* const files = files_of(keyframe_id);
  if (files == nullptr || files->normal.empty()) return {};
  const std::string extension = files->normal.extension().string();
  if (extension == ".pfm") return read_pfm3(files->normal);
  if (extension != ".exr") return read_png16_normals(files->normal);
  return read_exr_vectors(files->normal, {"N.X", "N.Y", "N.Z"});
}

Image<float> DepthFolder::read_confidence(std::int64_t keyframe_id) const {
  const Files* const files = files_of(keyframe_id);
  if (files == nullptr || files->confidence.empty()) return {};
  const std::string extension = files->confidence.extension().string();
  if (extension == ".pfm") return read_pfm(files->confidence);
  if (extension != ".exr") return read_png16(files->confidence, 1.0 / 65535.0);
  std::vector<ImageChannel> channels = read_exr(files->confidence, {"confidence"});
  return channels.empty() ? Image<float>() : std::move(channels.front().values);
}

}  // namespace pmsp
