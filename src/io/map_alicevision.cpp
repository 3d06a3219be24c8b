// SPDX-License-Identifier: BSD-2-Clause
//
// AliceVision (Meshroom) scenes as JSON, cameras.sfm: views, intrinsics, poses (rotation of cam_from_world,
// column-major, and centre) and optionally structure with observations. All numbers are strings. Axes are those of
// libpmsp; features have pixel centres at whole numbers, as in openMVG. The principal point is relative to the image
// centre, before version 1.2.1 to the corner.
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "map_file.h"
#include "map_scene.h"
#include "pmsp/camera.h"
#include "util/number_from.h"

namespace pmsp::map_detail {
namespace {

bool is_alicevision(MapFile& file) {
  if (!file.is_json()) return false;
  const nlohmann::json& json = file.json();
  if (!json.is_object() || !json.contains("views") || json.contains("sfm_data_version")) return false;
  const nlohmann::json& views = json["views"];
  return views.is_array() && !views.empty() && views.front().is_object() && views.front().contains("viewId");
}

/// Number, or string of one; NaN allowed.
double number_of(const JsonValue& value) {
  if (!value.is_text()) return value.number_or_nan();
  const std::optional<double> number = plain_number_from<double>(value.text());
  if (!number) value.refuse("a number");
  return *number;
}

std::int64_t whole_number_of(const JsonValue& value) {
  const double number = number_of(value);
  if (!(std::abs(number) < 1e15) || number != std::floor(number)) value.refuse("a whole number");
  return static_cast<std::int64_t>(number);
}

Eigen::Vector3d vector_of(const JsonValue& value) {
  if (value.size() != 3) value.refuse("an array of 3 numbers");
  return {number_of(value.element(0)), number_of(value.element(1)), number_of(value.element(2))};
}

bool is_before_1_2_1(const JsonValue& json) {
  if (!json.has("version")) return false;
  const Eigen::Vector3d version = vector_of(json.at("version"));
  return std::make_tuple(version.x(), version.y(), version.z()) < std::make_tuple(1.0, 2.0, 1.0);
}

/// Camera index by intrinsic id; -1 = not a panorama.
std::map<std::int64_t, int> read_alicevision_cameras(const JsonValue& json, SlamMap& map) {
  std::map<std::int64_t, int> cameras;
  const bool from_corner = is_before_1_2_1(json);
  json.at("intrinsics").each_element([&](const JsonValue& entry) {
    const std::int64_t id = whole_number_of(entry.at("intrinsicId"));
    const bool is_panorama = entry.at("type").text() == "equirectangular";
    if (!cameras.emplace(id, is_panorama ? static_cast<int>(map.cameras.size()) : -1).second) {
      entry.at("intrinsicId").refuse("an id that comes once");
    }
    if (!is_panorama) return;
    const double width = number_of(entry.at("width"));
    const double height = number_of(entry.at("height"));
    map.cameras.push_back(
        equirectangular_camera("intrinsic " + std::to_string(id), width, height, map.path, entry.where()));
    if (!entry.has("principalPoint")) return;
    const JsonValue point = entry.at("principalPoint");
    if (point.size() != 2) point.refuse("an array of 2 numbers");
    const Eigen::Vector2d off = Eigen::Vector2d(number_of(point.element(0)), number_of(point.element(1))) -
                                (from_corner ? 0.5 : 0.0) * Eigen::Vector2d(width, height);
    if (!(off.cwiseAbs().maxCoeff() <= 1.0)) {
      fail(map.path, point.where(),
           "is (" + to_message(off.x()) + ", " + to_message(off.y()) +
               ") from the middle of the image, expected a panorama whose middle looks forward, within a pixel");
    }
  });
  return cameras;
}

std::map<std::int64_t, RigidTransform> read_alicevision_poses(const JsonValue& json,
                                                              const std::filesystem::path& path) {
  std::map<std::int64_t, RigidTransform> poses;
  if (!json.has("poses")) return poses;
  json.at("poses").each_element([&](const JsonValue& entry) {
    const JsonValue transform = entry.at("pose").at("transform");
    const JsonValue rotation = transform.at("rotation");
    if (rotation.size() != 9) rotation.refuse("an array of 9 numbers");
    Eigen::Matrix3d matrix;
    for (std::size_t i = 0; i < 9; ++i) {
      matrix(static_cast<Eigen::Index>(i % 3), static_cast<Eigen::Index>(i / 3)) = number_of(rotation.element(i));
    }
    const Eigen::Matrix3d turn = rotation_from_matrix(matrix, path, rotation.where());
    const Eigen::Vector3d center = vector_of(transform.at("center"));
    if (!poses.emplace(whole_number_of(entry.at("poseId")), RigidTransform{turn, -(turn * center)}).second) {
      entry.at("poseId").refuse("an id that comes once");
    }
  });
  return poses;
}

void read_alicevision_structure(const JsonValue& json, const std::map<std::int64_t, std::string>& views, SlamMap& map) {
  if (!json.has("structure")) return;
  std::map<std::string, MapKeyframe*> by_image;
  for (MapKeyframe& keyframe : map.keyframes) by_image[keyframe.image] = &keyframe;
  json.at("structure").each_element([&](const JsonValue& entry) {
    const std::int64_t id = whole_number_of(entry.at("landmarkId"));
    map.landmarks.push_back({id, vector_of(entry.at("X"))});
    if (!entry.has("observations")) return;
    entry.at("observations").each_element([&](const JsonValue& observation) {
      const auto view = views.find(whole_number_of(observation.at("observationId")));
      if (view == views.end() || !observation.has("x")) return;  // view was dropped, or the position is missing
      const JsonValue pixel = observation.at("x");
      if (pixel.size() != 2) pixel.refuse("an array of 2 numbers");
      const Eigen::Vector2d at(number_of(pixel.element(0)) + 0.5, number_of(pixel.element(1)) + 0.5);
      by_image.at(view->second)->observations.push_back({id, at.cast<float>()});
    });
  });
}

SlamMap read_alicevision(MapFile& file, const ReadMapOptions& /*options*/) {
  const JsonValue json(file.json(), file.path());
  SlamMap map;
  map.path = file.path();
  map.format = "AliceVision";
  map.pixel_centers_at_integers = true;
  const std::map<std::int64_t, int> cameras = read_alicevision_cameras(json, map);
  const std::map<std::int64_t, RigidTransform> poses = read_alicevision_poses(json, map.path);
  std::map<std::int64_t, std::string> views;  // image by view id
  std::size_t without_pose = 0;
  std::size_t others = 0;
  json.at("views").each_element([&](const JsonValue& view) {
    const bool is_in_rig = view.has("rigId") && view.has("isPoseIndependant");
    const auto pose = view.has("poseId") ? poses.find(whole_number_of(view.at("poseId"))) : poses.end();
    if (pose == poses.end() || !view.has("intrinsicId") || is_in_rig) {
      ++without_pose;
      return;
    }
    const auto camera = cameras.find(whole_number_of(view.at("intrinsicId")));
    if (camera == cameras.end()) view.at("intrinsicId").refuse("the id of one of \"intrinsics\"");
    if (camera->second < 0) {
      ++others;
      return;
    }
    MapKeyframe keyframe;
    keyframe.camera = camera->second;
    keyframe.image = image_name(view.at("path").text(), map.path, view.where());
    const int width = map.cameras[static_cast<std::size_t>(camera->second)].width;
    keyframe.cam_from_world = cam_from_slam_cam(width) * pose->second;
    if (!views.emplace(whole_number_of(view.at("viewId")), keyframe.image).second) {
      view.at("viewId").refuse("an id that comes once");
    }
    map.keyframes.push_back(std::move(keyframe));
  });
  if (without_pose > 0) {
    map.notes.push_back("views left out, without a pose of their own: " + std::to_string(without_pose));
  }
  note_others(map, "views left out, of cameras that are not equirectangular", others);
  number_by_image(map);
  read_alicevision_structure(json, views, map);
  return finalize_map(std::move(map));
}

}  // namespace

extern const MapFormat kAliceVision;
const MapFormat kAliceVision{"AliceVision", "cameras.sfm of AliceVision", is_alicevision, read_alicevision};

}  // namespace pmsp::map_detail
