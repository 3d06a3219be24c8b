// SPDX-License-Identifier: BSD-2-Clause
//
// openMVG's sfm_data.json: views, intrinsics, extrinsics (rotation of cam_from_world, and centre) and structure with
// observations. Axes are those of libpmsp; features have pixel centres at whole numbers while the projection has the
// forward direction at width / 2, as in SLAM programs (see SlamMap). cereal writes the type name of an intrinsic only
// at its first use, and a number afterwards.
#include <algorithm>
#include <cstdint>
#include <map>
#include <string>

#include "map_file.h"
#include "map_scene.h"
#include "pmsp/camera.h"

namespace pmsp::map_detail {
namespace {

constexpr std::int64_t kNone = 0xFFFFFFFF;
constexpr std::int64_t kFirstOfItsType = 0x80000000;

bool is_openmvg(MapFile& file) {
  if (!file.is_json()) return false;
  const nlohmann::json& json = file.json();
  return json.is_object() && json.contains("sfm_data_version");
}

/// Fields behind a pointer of cereal.
JsonValue data_of(const JsonValue& value) {
  const JsonValue data = value.at("ptr_wrapper").at("data");
  return data.has("value0") ? data.at("value0") : data;
}

/// Camera index by intrinsic id; -1 = not a panorama.
std::map<std::int64_t, int> read_openmvg_cameras(const JsonValue& json, SlamMap& map) {
  std::map<std::int64_t, int> cameras;
  std::map<std::int64_t, std::string> types;
  json.at("intrinsics").each_element([&](const JsonValue& entry) {
    const std::int64_t id = entry.at("key").integer();
    const JsonValue value = entry.at("value");
    const std::int64_t type = value.at("polymorphic_id").integer() & ~kFirstOfItsType;
    if (value.has("polymorphic_name")) types[type] = value.at("polymorphic_name").text();
    const bool is_panorama = types.count(type) != 0 && types[type] == "spherical";
    const int index = is_panorama ? static_cast<int>(map.cameras.size()) : -1;
    if (!cameras.emplace(id, index).second) entry.at("key").refuse("an id that comes once");
    if (!is_panorama) return;
    const JsonValue data = data_of(value);
    map.cameras.push_back(
        equirectangular_camera("intrinsic " + std::to_string(id), static_cast<double>(data.at("width").integer()),
                               static_cast<double>(data.at("height").integer()), map.path, data.where()));
  });
  return cameras;
}

std::map<std::int64_t, RigidTransform> read_openmvg_poses(const JsonValue& json, const std::filesystem::path& path) {
  std::map<std::int64_t, RigidTransform> poses;
  json.at("extrinsics").each_element([&](const JsonValue& entry) {
    const JsonValue rotation = entry.at("value").at("rotation");
    const Eigen::Matrix3d turn = rotation_from_matrix(rotation.matrix3(), path, rotation.where());
    const Eigen::Vector3d center = entry.at("value").at("center").vector3();
    if (!poses.emplace(entry.at("key").integer(), RigidTransform{turn, -(turn * center)}).second) {
      entry.at("key").refuse("an id that comes once");
    }
  });
  return poses;
}

void read_openmvg_structure(const JsonValue& json, SlamMap& map) {
  std::map<std::int64_t, MapKeyframe*> keyframes;
  for (MapKeyframe& keyframe : map.keyframes) {
    if (!keyframes.emplace(keyframe.id, &keyframe).second) {
      fail(map.path, "views", "view " + std::to_string(keyframe.id) + " appears more than once, expected unique ids");
    }
  }
  if (!json.has("structure")) return;
  json.at("structure").each_element([&](const JsonValue& entry) {
    const std::int64_t id = entry.at("key").integer();
    map.landmarks.push_back({id, entry.at("value").at("X").vector3()});
    entry.at("value").at("observations").each_element([&](const JsonValue& observation) {
      const auto found = keyframes.find(observation.at("key").integer());
      if (found == keyframes.end()) return;  // view without pose
      const JsonValue pixel = observation.at("value").at("x");
      if (pixel.size() != 2) pixel.refuse("an array of 2 numbers");
      const Eigen::Vector2d at(pixel.element(0).number() + 0.5, pixel.element(1).number() + 0.5);
      found->second->observations.push_back({id, at.cast<float>()});
    });
  });
}

SlamMap read_openmvg(MapFile& file, const ReadMapOptions& /*options*/) {
  const JsonValue json(file.json(), file.path());
  SlamMap map;
  map.path = file.path();
  map.format = "openMVG " + json.at("sfm_data_version").text();
  map.pixel_centers_at_integers = true;
  const std::map<std::int64_t, int> cameras = read_openmvg_cameras(json, map);
  const std::map<std::int64_t, RigidTransform> poses = read_openmvg_poses(json, map.path);
  std::size_t without_pose = 0;
  std::size_t others = 0;
  json.at("views").each_element([&](const JsonValue& entry) {
    const JsonValue view = data_of(entry.at("value"));
    const std::int64_t intrinsic = view.at("id_intrinsic").integer();
    const auto pose = poses.find(view.at("id_pose").integer());
    if (pose == poses.end() || intrinsic == kNone) {
      ++without_pose;
      return;
    }
    const auto camera = cameras.find(intrinsic);
    if (camera == cameras.end()) view.at("id_intrinsic").refuse("the key of one of \"intrinsics\"");
    if (camera->second < 0) {
      ++others;
      return;
    }
    MapKeyframe keyframe;
    keyframe.id = view.at("id_view").integer();
    keyframe.camera = camera->second;
    const std::string folder = view.at("local_path").text();
    keyframe.image =
        image_name((folder.empty() ? "" : folder + "/") + view.at("filename").text(), map.path, view.where());
    const int width = map.cameras[static_cast<std::size_t>(camera->second)].width;
    keyframe.cam_from_world = cam_from_slam_cam(width) * pose->second;
    map.keyframes.push_back(std::move(keyframe));
  });
  if (without_pose > 0) map.notes.push_back("views left out, without a pose: " + std::to_string(without_pose));
  note_others(map, "views left out, of cameras that are not spherical", others);
  read_openmvg_structure(json, map);
  map.images = inner_folder(json.at("root_path").text(), map);
  return finalize_map(std::move(map));
}

}  // namespace

extern const MapFormat kOpenMvg;
const MapFormat kOpenMvg{"openMVG", "sfm_data.json of openMVG", is_openmvg, read_openmvg};

}  // namespace pmsp::map_detail
