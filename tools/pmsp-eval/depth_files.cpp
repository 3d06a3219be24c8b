// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/depth_files.h"

#include <algorithm>
#include <string>
#include <system_error>

#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "util/number_from.h"
#include "util/numbered_name.h"

namespace pmsp::eval {
namespace {

namespace fs = std::filesystem;

void add_folder(const fs::path& folder, const char* extension, std::vector<DepthFile>& files) {
  std::error_code error;
  const std::size_t before = files.size();
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const auto id = number_in_name(it->path(), "depth_", extension);
    if (id) files.push_back({*id, it->path()});
  }
  if (error) throw IoError(folder.string() + ": cannot list the directory: " + error.message());
  if (files.size() == before) {
    throw InvalidInput(folder.string() + ": holds no depth_<keyframe id>" + extension +
                       (std::string(extension) == ".pfm" ? " (for 16-bit PNG set --png-scale)" : ""));
  }
}

/// Path of another image of the same keyframe as a depth map, "" = missing. `prefix`: "confidence_".
fs::path file_beside(const fs::path& depth_path, const std::string& prefix) {
  const std::string name = depth_path.filename().string();
  if (!number_in_name(depth_path, "depth_", depth_path.extension().string())) return {};
  fs::path path = depth_path.parent_path() / (prefix + name.substr(6));
  path.replace_extension(".pfm");
  return fs::exists(path) ? path : fs::path();
}

}  // namespace

std::optional<std::int64_t> number_in_name(const fs::path& path, const std::string& prefix,
                                           const std::string& extension) {
  return number_from<std::int64_t>(digits_in_name(path.filename().string(), prefix, extension));
}

std::vector<DepthFile> list_depth_files(const std::vector<fs::path>& inputs, double png_scale,
                                        std::optional<std::int64_t> keyframe) {
  std::vector<DepthFile> files;
  for (const fs::path& input : inputs) {
    if (!fs::exists(input)) throw IoError(input.string() + ": no such file or directory");
    if (fs::is_directory(input)) {
      add_folder(input, png_scale > 0.0 ? ".png" : ".pfm", files);
      continue;
    }
    const auto id = keyframe ? keyframe : number_in_name(input, "depth_", input.extension().string());
    if (!id) {
      throw InvalidInput(input.string() + ": the name is not depth_<keyframe id>; name the keyframe with --keyframe");
    }
    files.push_back({*id, input});
  }
  if (keyframe && inputs.size() == 1 && fs::is_directory(inputs.front())) {
    files.erase(std::remove_if(files.begin(), files.end(), [&](const auto& f) { return f.keyframe_id != *keyframe; }),
                files.end());
    if (files.empty()) {
      throw InvalidInput(inputs.front().string() + ": holds no depth map of keyframe " + std::to_string(*keyframe));
    }
  }
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.keyframe_id < b.keyframe_id; });
  for (std::size_t i = 1; i < files.size(); ++i) {
    if (files[i].keyframe_id == files[i - 1].keyframe_id) {
      throw InvalidInput(files[i].path.string() + ": keyframe " + std::to_string(files[i].keyframe_id) +
                         " has a second depth map, " + files[i - 1].path.string());
    }
  }
  return files;
}

Image<float> load_depth(const fs::path& path, double png_scale) {
  Image<float> depth;
  if (path.extension() == ".png") {
    if (!(png_scale > 0.0)) {
      throw InvalidInput(path.string() + ": a PNG needs --png-scale, the length of one gray level in map units");
    }
    depth = read_png16(path, png_scale);
  } else {
    depth = read_pfm(path);
  }
  if (depth.empty() || depth.width() != 2 * depth.height()) {
    throw InvalidInput(path.string() + ": the depth map has " + std::to_string(depth.width()) + " x " +
                       std::to_string(depth.height()) + " pixels, expected twice as wide as high");
  }
  return depth;
}

Image<float> load_confidence(const fs::path& depth_path, int width, int height) {
  const fs::path path = file_beside(depth_path, "confidence_");
  if (path.empty()) return {};
  Image<float> confidence = read_pfm(path);
  if (confidence.width() != width || confidence.height() != height) {
    throw InvalidInput(path.string() + ": the confidence has " + std::to_string(confidence.width()) + " x " +
                       std::to_string(confidence.height()) + " pixels, its depth map " + std::to_string(width) + " x " +
                       std::to_string(height));
  }
  return confidence;
}

Image<Eigen::Vector3f> load_normals(const fs::path& depth_path) {
  const fs::path path = file_beside(depth_path, "normal_");
  if (path.empty()) return {};
  Image<Eigen::Vector3f> normals = read_pfm3(path);
  if (normals.empty() || normals.width() != 2 * normals.height()) {
    throw InvalidInput(path.string() + ": the image of normals has " + std::to_string(normals.width()) + " x " +
                       std::to_string(normals.height()) + " pixels, expected twice as wide as high");
  }
  return normals;
}

}  // namespace pmsp::eval
