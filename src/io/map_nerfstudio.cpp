// SPDX-License-Identifier: BSD-2-Clause
//
// nerfstudio's transforms.json: frames with camera-to-world matrices in OpenGL axes (x right, y up, z backward), and
// optionally a PLY file of points in the same world. Observations are not contained.
#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "export/files.h"
#include "map_file.h"
#include "map_scene.h"

namespace pmsp::map_detail {
namespace {

bool is_nerfstudio(MapFile& file) {
  if (!file.is_json()) return false;
  const nlohmann::json& json = file.json();
  return json.is_object() && json.contains("frames") && !json.contains("sfm_data_version");
}

/// Of the frame, or else of the file.
std::string camera_model(const JsonValue& json, const JsonValue& frame) {
  for (const JsonValue* value : {&frame, &json}) {
    if (value->has("camera_model")) return value->at("camera_model").text();
  }
  return "PERSPECTIVE";
}

/// Cameras of the frames, one per size.
class Cameras {
 public:
  explicit Cameras(SlamMap& map) : map_(map) {}

  int of(const JsonValue& json, const JsonValue& frame) {
    const JsonValue& value = frame.has("w") ? frame : json;
    if (!value.has("w")) return index_of(0, [] { return equirectangular_camera_of_unknown_size(); });
    const std::int64_t width = value.at("w").integer();
    return index_of(width, [&] {
      return equirectangular_camera("panorama " + std::to_string(width), static_cast<double>(width),
                                    static_cast<double>(value.at("h").integer()), map_.path, value.where());
    });
  }

 private:
  template <class Make>
  int index_of(std::int64_t width, const Make& make) {
    const auto found = by_width_.find(width);
    if (found != by_width_.end()) return found->second;
    map_.cameras.push_back(make());
    return by_width_[width] = static_cast<int>(map_.cameras.size()) - 1;
  }

  SlamMap& map_;
  std::map<std::int64_t, int> by_width_;
};

/// Longest tail of the path that is a file in the folder, else a path that does not exist; "" = no mask is named.
std::filesystem::path mask_file(const std::filesystem::path& folder, const JsonValue& value) {
  constexpr std::size_t kLongest = 4096;
  constexpr std::ptrdiff_t kMaxParts = 8;
  std::string name = value.is_text() ? value.text() : "";
  std::replace(name.begin(), name.end(), '\\', '/');
  const bool is_name = !name.empty() && name.size() <= kLongest &&
                       std::none_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20U || c == 0x7F; });
  if (!is_name) return {};
  std::vector<std::filesystem::path> parts;
  for (const auto& part : std::filesystem::path(name).lexically_normal().relative_path()) parts.push_back(part);
  for (auto first = parts.end() - std::min(kMaxParts, parts.end() - parts.begin()); first != parts.end(); ++first) {
    std::filesystem::path file = folder;
    for (auto part = first; part != parts.end(); ++part) file /= *part;
    if (*first != ".." && is_file(file)) return file;
  }
  const bool is_inside = !parts.empty() && parts.front() != ".." && std::filesystem::path(name).is_relative();
  return folder / (is_inside ? std::filesystem::path(name).lexically_normal() : std::filesystem::path(name).filename());
}

SlamMap read_nerfstudio(MapFile& file, const ReadMapOptions& /*options*/) {
  const JsonValue json(file.json(), file.path());
  SlamMap map;
  map.path = file.path();
  map.format = "nerfstudio";
  map.images = file.path().parent_path();
  if (map.images.empty()) map.images = ".";
  Cameras cameras(map);
  std::map<std::string, std::size_t> others;
  json.at("frames").each_element([&](const JsonValue& frame) {
    const std::string model = camera_model(json, frame);
    if (model != "EQUIRECTANGULAR") {
      ++others[model];
      return;
    }
    MapKeyframe keyframe;
    keyframe.camera = cameras.of(json, frame);
    keyframe.image = image_name(frame.at("file_path").text(), map.path, frame.where());
    if (frame.has("mask_path")) keyframe.mask = mask_file(map.images, frame.at("mask_path"));
    const JsonValue matrix = frame.at("transform_matrix");
    const Eigen::Matrix4d world_from_camera = matrix.matrix4();
    const Eigen::Matrix3d rotation =
        world_from_camera.topLeftCorner<3, 3>() * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
    const Eigen::Matrix3d turn = rotation_from_matrix(rotation.transpose(), map.path, matrix.where());
    keyframe.cam_from_world = {turn, -(turn * world_from_camera.topRightCorner<3, 1>())};
    map.keyframes.push_back(std::move(keyframe));
  });
  for (const auto& [model, count] : others) {
    map.notes.push_back("frames left out, of the camera model " + in_quotes(model) + ": " + std::to_string(count) +
                        "; only panoramas can be used (EQUIRECTANGULAR)");
  }
  number_by_image(map);
  if (json.has("ply_file_path")) {
    const JsonValue points = json.at("ply_file_path");
    const std::string name = image_name(points.text(), map.path, points.where());
    const std::filesystem::path found = longest_tail(map.images, name);
    map.landmarks = landmarks_from_ply(found.empty() ? map.images / name : found);
  }
  return finalize_map(std::move(map));
}

}  // namespace

extern const MapFormat kNerfstudio;
const MapFormat kNerfstudio{"nerfstudio", "transforms.json of nerfstudio", is_nerfstudio, read_nerfstudio};

}  // namespace pmsp::map_detail
