// SPDX-License-Identifier: BSD-2-Clause
#include "depth_output.h"

#include "arguments.h"
#include "export/files.h"
#include "pmsp/io/depth.h"
#include "tool_files.h"

namespace pmsp::tool {
namespace {

/// Meaning of confidence values at each stage, see DepthMap.
const char* confidence_text(const std::string& kind) {
  return kind == "raw" ? "photometric score (NCC), 0 (none) to 1"
                       : "0 (none) to 1: c means an expected (median) relative error of the depth of "
                         "0.5 % * (1 - c) / c, so 0.5 for 0.5 %, 0.8 for 0.13 % and 0.1 for 4.5 %";
}

nlohmann::ordered_json pose_json(const RigidTransform& pose) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int r = 0; r < 3; ++r) {
    rows.push_back({pose.rotation(r, 0), pose.rotation(r, 1), pose.rotation(r, 2), pose.translation(r)});
  }
  return rows;
}

}  // namespace

double png_depth_scale(const SlamMap& map, double range_margin) {
  const double farthest = farthest_landmarks(map);
  return farthest > 0.0 ? farthest * range_margin / 65535.0 : 1e-3;
}

DepthMapFolder::DepthMapFolder(const std::filesystem::path& folder, const SlamMap& map, const DepthFormats& formats,
                               const About& about)
    : folder_(folder, is_depth_map_file), slam_map_(map), png_scale_(about.png_scale), formats_(formats) {
  index_ = {
      {"generator", version_text()},
      {"kind", about.kind},
      {"depth",
       "Euclidean distance from the camera centre (or from the lens, lens_distance / 2 in front of it or behind it) "
       "along the ray of each pixel's centre, map units; 0 = none"},
      {"normal", "unit, camera frame (x right, y down, z forward), facing the camera; 0 0 0 = none"},
      {"confidence", confidence_text(about.kind)},
      {"pixel", "longitude = ((column + 0.5) / width - 0.5) * 2 pi, latitude = (0.5 - (row + 0.5) / height) * pi"},
      {"pfm", "float32, rows from the bottom to the top, as the format requires"},
      {"png", "depth = gray value * png_scale; 0 = none, or farther than 65535 * png_scale"},
      {"normal_png", "x, y, z = red, green, blue / 65535 * 2 - 1; all 0 = none"},
      {"confidence_png", "confidence = gray value / 65535"},
      {"exr", "channels Z (depth), N.X, N.Y, N.Z, confidence; float32"},
      {"cam_from_world", "three rows of [rotation | translation]"},
      {"png_scale", png_scale_},
      {"lens_distance", about.lens_distance},
      {"cloud", about.cloud},
      {"maps", nlohmann::ordered_json::array()}};
}

void DepthMapFolder::write(const DepthMap& map) {
  if (map.scale != 1.0) {
    DepthMap in_scene_units = map;
    for (float& depth : in_scene_units.depth.pixels()) depth *= static_cast<float>(map.scale);
    in_scene_units.scale = 1.0;
    return write(in_scene_units);
  }
  const MapKeyframe* keyframe = slam_map_.find_keyframe(map.keyframe_id);
  nlohmann::ordered_json entry{{"keyframe_id", map.keyframe_id},
                               {"timestamp", keyframe != nullptr ? keyframe->timestamp : 0.0},
                               {"width", map.depth.width()},
                               {"height", map.depth.height()},
                               {"cam_from_world", pose_json(map.cam_from_world)}};
  const auto file = [&](const char* key, const char* prefix, const char* extension) {
    const std::string name = numbered_name(prefix, map.keyframe_id, extension);
    entry[key] = name;
    return folder_ / name;
  };
  if (formats_.pfm) {
    write_pfm(file("depth", "depth_", ".pfm"), map.depth);
    write_pfm(file("normal", "normal_", ".pfm"), map.normal);
    write_pfm(file("confidence", "confidence_", ".pfm"), map.confidence);
  }
  if (formats_.depth_png || formats_.png) write_png16(file("depth_png", "depth_", ".png"), map.depth, 1.0 / png_scale_);
  if (formats_.png) {
    write_png16(file("normal_png", "normal_", ".png"), map.normal);
    write_png16(file("confidence_png", "confidence_", ".png"), map.confidence, 65535.0);
  }
  if (formats_.exr) write_depth_exr(file("exr", "depth_", ".exr"), map);
  index_["maps"].push_back(entry);
}

void DepthMapFolder::write_index() const { write_file(folder_ / "index.json", json_text(index_)); }

bool is_depth_map_file(const std::string& name) {
  return name == "index.json" || is_numbered_name(name, "depth_", ".pfm") || is_numbered_name(name, "depth_", ".png") ||
         is_numbered_name(name, "depth_", ".exr") || is_numbered_name(name, "normal_", ".pfm") ||
         is_numbered_name(name, "normal_", ".png") || is_numbered_name(name, "confidence_", ".pfm") ||
         is_numbered_name(name, "confidence_", ".png");
}

}  // namespace pmsp::tool
