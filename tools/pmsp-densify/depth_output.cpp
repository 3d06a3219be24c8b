// SPDX-License-Identifier: BSD-2-Clause
#include "depth_output.h"

#include <algorithm>
#include <vector>

#include "arguments.h"
#include "export/atomic_file.h"
#include "map_figures.h"
#include "output_folder.h"
#include "pmsp/error.h"
#include "pmsp/io/depth_io.h"

namespace pmsp::tool {
namespace {

/// What `confidence` holds at each stage, see DepthMap.
const char* confidence_text(const std::string& kind) {
  return kind == "raw" ? "photometric score (NCC), 0 (none) to 1"
                       : "0 (none) to 1: c stands for an expected relative error of the depth (median) of "
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
  double farthest = 0.0;
  for (const MapKeyframe& keyframe : map.keyframes) {
    std::vector<double> depths = landmark_depths(map, keyframe);
    farthest = std::max(farthest, percentile(depths, 98.0));
  }
  return farthest > 0.0 ? farthest * range_margin / 65535.0 : 1e-3;
}

DepthMapFolder::DepthMapFolder(const std::filesystem::path& folder, const std::string& kind, const SlamMap& map,
                               double png_scale)
    : folder_(folder), slam_map_(map), png_scale_(png_scale) {
  prepare_folder(folder_, is_depth_map_file);
  index_ = {
      {"generator", version_text()},
      {"kind", kind},
      {"depth",
       "Euclidean distance from the camera centre along the ray of each pixel's centre, scene units; 0 = none"},
      {"normal", "unit, camera frame (x right, y down, z forward), facing the camera; 0 0 0 = none"},
      {"confidence", confidence_text(kind)},
      {"pixel", "longitude = ((column + 0.5) / width - 0.5) * 2 pi, latitude = (0.5 - (row + 0.5) / height) * pi"},
      {"pfm", "float32, rows from the bottom to the top, as the format wants it"},
      {"png", "depth = gray value * png_scale; 0 = none, or farther than 65535 * png_scale"},
      {"cam_from_world", "three rows of [rotation | translation]"},
      {"png_scale", png_scale_},
      {"maps", nlohmann::ordered_json::array()}};
}

void DepthMapFolder::write(const DepthMap& map) {
  const std::string depth = numbered_name("depth_", map.keyframe_id, ".pfm");
  const std::string normal = numbered_name("normal_", map.keyframe_id, ".pfm");
  const std::string confidence = numbered_name("confidence_", map.keyframe_id, ".pfm");
  const std::string png = numbered_name("depth_", map.keyframe_id, ".png");
  write_pfm(folder_ / depth, map.depth);
  write_pfm(folder_ / normal, map.normal);
  write_pfm(folder_ / confidence, map.confidence);
  write_png16(folder_ / png, map.depth, 1.0 / png_scale_);
  const MapKeyframe* keyframe = slam_map_.find_keyframe(map.keyframe_id);
  index_["maps"].push_back({{"keyframe_id", map.keyframe_id},
                            {"timestamp", keyframe != nullptr ? keyframe->timestamp : 0.0},
                            {"width", map.depth.width()},
                            {"height", map.depth.height()},
                            {"cam_from_world", pose_json(map.cam_from_world)},
                            {"depth", depth},
                            {"normal", normal},
                            {"confidence", confidence},
                            {"depth_png", png}});
}

void DepthMapFolder::finish() const { write_file(folder_ / "index.json", json_text(index_)); }

bool is_depth_map_file(const std::string& name) {
  return name == "index.json" || is_numbered_name(name, "depth_", ".pfm") || is_numbered_name(name, "depth_", ".png") ||
         is_numbered_name(name, "normal_", ".pfm") || is_numbered_name(name, "confidence_", ".pfm");
}

std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace pmsp::tool
