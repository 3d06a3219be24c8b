// SPDX-License-Identifier: BSD-2-Clause
#include "export/dataset_depth.h"

#include <cmath>
#include <cstddef>
#include <system_error>
#include <utility>

#include "export/files.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "util/numbered_name.h"

namespace pmsp {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kFolders[] = {"depths", "normals", "confidences"};
constexpr const char* kTemporary = ".keyframe_";  ///< prefix of names before `finish`

std::string temporary_stem(std::int64_t keyframe_id) { return numbered_name(kTemporary, keyframe_id, ""); }

}  // namespace

DatasetDepthFiles::DatasetDepthFiles(const fs::path& folder, const DatasetDepth& options, double scale)
    : folder_(folder), options_(options), scale_(scale) {}

/// The depth map in units of the file, with distances from the camera centre.
DepthMap DatasetDepthFiles::from_centre(const DepthMap& map) const {
  DepthMap result = map;
  const double lens = 0.5 * options_.lens_distance;
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      double depth = map.depth.row(y)[x];
      if (!(depth > 0.0)) continue;
      if (lens != 0.0) {
        const Eigen::Vector3d ray = bearing_from_pixel({x + 0.5, y + 0.5}, map.depth.width(), map.depth.height());
        depth = std::sqrt(depth * depth + 2.0 * depth * lens * std::abs(ray.z()) + lens * lens);
      }
      result.depth.row(y)[x] = static_cast<float>(depth * map.scale * scale_);
    }
  }
  result.scale = 1.0;
  return result;
}

std::vector<std::string> DatasetDepthFiles::names_of(const std::string& stem) const {
  std::vector<std::string> names;
  for (const char* folder : kFolders) {
    if (options_.png) names.push_back(std::string(folder) + "/" + stem + ".png");
  }
  if (options_.exr) names.push_back("depths/" + stem + ".exr");
  return names;
}

void DatasetDepthFiles::write(const std::string& stem, const DepthMap& map) const {
  for (const char* folder : kFolders) {
    if (options_.png || folder == kFolders[0]) make_folder(folder_ / folder);
  }
  if (options_.png) {
    write_png16(folder_ / "depths" / (stem + ".png"), map.depth, 1.0 / options_.png_scale);
    write_png16(folder_ / "normals" / (stem + ".png"), map.normal);
    write_png16(folder_ / "confidences" / (stem + ".png"), map.confidence, 65535.0);
  }
  if (options_.exr) write_depth_exr(folder_ / "depths" / (stem + ".exr"), map);
}

void DatasetDepthFiles::add(const DepthMap& map) {
  size_ = {map.depth.width(), map.depth.height()};
  write(temporary_stem(map.keyframe_id), from_centre(map));
  written_.insert(map.keyframe_id);
}

void DatasetDepthFiles::finish(const std::vector<OutputView>& views) {
  if (written_.empty()) return;
  std::set<std::string> taken;
  for (const OutputView& view : views) {
    std::string stem = fs::path(view.name).stem().string();
    if (!taken.insert(stem).second) stem = view.name;  // a.jpg beside a.png
    taken.insert(stem);
    stems_[view.keyframe_id] = stem;
    if (written_.erase(view.keyframe_id) == 0) {
      DepthMap none;
      none.depth = none.confidence = Image<float>(size_.width, size_.height, 0.0F);
      none.normal = Image<Eigen::Vector3f>(size_.width, size_.height, Eigen::Vector3f::Zero());
      write(stem, none);
      continue;
    }
    const std::vector<std::string> from = names_of(temporary_stem(view.keyframe_id)), to = names_of(stem);
    for (std::size_t i = 0; i < from.size(); ++i) {
      std::error_code error;
      fs::rename(folder_ / from[i], folder_ / to[i], error);
      if (error) throw OutputError((folder_ / to[i]).string() + ": cannot be written: " + error.message());
    }
  }
  std::error_code ignored;
  for (const std::int64_t id : written_) {  // without image in the dataset
    for (const std::string& name : names_of(temporary_stem(id))) fs::remove(folder_ / name, ignored);
  }
}

Json DatasetDepthFiles::files_of(const OutputView& view) const {
  const auto found = stems_.find(view.keyframe_id);
  if (found == stems_.end()) return Json::object();
  const std::string& stem = found->second;
  Json json;
  json["depth_file_path"] = "depths/" + stem + (options_.png ? ".png" : ".exr");
  if (options_.png) {
    json["normal_file_path"] = "normals/" + stem + ".png";
    json["confidence_file_path"] = "confidences/" + stem + ".png";
  }
  if (options_.exr) json["exr_file_path"] = "depths/" + stem + ".exr";
  return json;
}

Json DatasetDepthFiles::description() const {
  Json json{
      {"is_euclidean_depth", true},
      {"depth",
       "Euclidean distance from the camera centre along the ray of the pixel's centre, in the unit of "
       "the poses; 0 = none"},
      {"normal", "unit, camera frame (x right, y down, z forward), facing the camera; 0 0 0 = none"},
      {"confidence", "0 (none) to 1: c means an expected (median) relative error of the depth of 0.5 % * (1 - c) / c"}};
  if (options_.png) {
    json["depth_unit_scale_factor"] = options_.png_scale;
    json["depth_png"] = "depth = gray value * depth_unit_scale_factor";
    json["normal_png"] = "x, y, z = red, green, blue / 65535 * 2 - 1; all 0 = none";
    json["confidence_png"] = "confidence = gray value / 65535";
  }
  if (options_.exr) json["exr"] = "channels Z (depth), N.X, N.Y, N.Z, confidence; float32";
  return json;
}

void DatasetDepthFiles::remove_stale(const fs::path& folder, const std::vector<OutputView>& views,
                                     const DatasetDepthFiles* files) {
  std::set<fs::path> kept;
  if (files != nullptr) {
    for (const auto& [id, stem] : files->stems_) {
      for (const std::string& name : files->names_of(stem)) kept.insert(folder / name);
    }
  }
  std::error_code ignored;
  for (const OutputView& view : views) {
    for (const std::string& stem : {fs::path(view.name).stem().string(), view.name}) {
      for (const char* kind : kFolders) {
        for (const char* extension : {".png", ".exr"}) {
          const fs::path file = folder / kind / (stem + extension);
          if (kept.count(file) == 0) fs::remove(file, ignored);
        }
      }
    }
  }
  for (const char* kind : kFolders) {
    if (fs::is_empty(folder / kind, ignored)) fs::remove(folder / kind, ignored);
  }
  if (files == nullptr) fs::remove(folder / "depths.json", ignored);
}

}  // namespace pmsp
