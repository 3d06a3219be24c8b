// SPDX-License-Identifier: BSD-2-Clause
//
// Panoramas of published benchmarks, with true poses:
// - OB3D: directory of a path through a scene, with cameras/00000_cam.json (OpenCV's axes, cam_from_world),
//   images/00000_rgb.png and sparse/sparse.ply;
// - TartanAir V2 as packaged for COLMAP's benchmark: scene.json (frames and their images) beside poses.txt (frame,
//   position and quaternion of the body, x forward, y right, z down) and images/. The middle of these panoramas looks
//   to the left of the body.
#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "export/files.h"
#include "map_file.h"
#include "map_scene.h"
#include "text_input.h"
#include "util/numbered_name.h"

namespace pmsp::map_detail {
namespace {

namespace fs = std::filesystem;

/// Camera index of an image size in the map; adds the camera if it is new.
int camera_of_size(SlamMap& map, const JsonValue& width, const JsonValue& height, const fs::path& path) {
  MapCamera camera = equirectangular_camera("", width.number(), height.number(), path, width.where());
  camera.name = "panorama " + std::to_string(camera.width) + " x " + std::to_string(camera.height);
  const auto same = [&](const MapCamera& other) { return other.name == camera.name; };
  const auto found = std::find_if(map.cameras.begin(), map.cameras.end(), same);
  if (found != map.cameras.end()) return static_cast<int>(found - map.cameras.begin());
  map.cameras.push_back(std::move(camera));
  return static_cast<int>(map.cameras.size()) - 1;
}

// --- OB3D

constexpr const char* kCameraEnding = "_cam.json";

/// Camera files by number.
std::map<std::int64_t, fs::path> ob3d_cameras(const fs::path& folder) {
  std::map<std::int64_t, fs::path> files;
  std::error_code error;
  for (fs::directory_iterator it(folder / "cameras", error), end; !error && it != end; it.increment(error)) {
    const auto number = number_from<std::int64_t>(digits_in_name(it->path().filename().string(), "", kCameraEnding));
    if (!number) continue;
    const auto [other, is_new] = files.emplace(*number, it->path());
    if (!is_new)
      fail(it->path(), "", "has the number of " + other->second.string() + ", expected one file of a number");
  }
  return files;
}

bool is_ob3d(MapFile& file) { return file.is_folder() && !ob3d_cameras(file.path()).empty(); }

SlamMap read_ob3d(MapFile& file, const ReadMapOptions& /*options*/) {
  SlamMap map;
  map.path = file.path();
  map.format = "OB3D";
  map.images = file.path() / "images";
  for (const auto& [number, path] : ob3d_cameras(file.path())) {
    const nlohmann::json json = read_json(path);
    const JsonValue root(json, path);
    if (!json.is_array() || json.size() != 1) root.refuse("an array of one camera");
    const JsonValue camera = root.element(0);
    if (camera.has("id") && camera.at("id").integer() != number) {
      camera.at("id").refuse("the number of the file, " + std::to_string(number));
    }
    MapKeyframe keyframe;
    keyframe.id = number;
    keyframe.camera = camera_of_size(map, camera.at("width"), camera.at("height"), path);
    const JsonValue pose = camera.at("extrinsics");
    keyframe.cam_from_world = {rotation_from_matrix(pose.at("rotation").matrix3(), path, pose.at("rotation").where()),
                               pose.at("translation").vector3()};
    const std::string name = path.filename().string();
    keyframe.image = name.substr(0, name.size() - std::string(kCameraEnding).size()) + "_rgb.png";
    map.keyframes.push_back(std::move(keyframe));
  }
  const fs::path points = file.path() / "sparse" / "sparse.ply";
  if (is_file(points)) map.landmarks = landmarks_from_ply(points);
  return finalize_map(std::move(map));
}

// --- TartanAir

bool is_tartanair(MapFile& file) {
  if (!file.is_json()) return false;
  const nlohmann::json& json = file.json();
  return json.is_object() && json.contains("frames") && json.contains("trajectory") && json.contains("depth_scale");
}

/// world_from_camera by frame.
std::map<std::int64_t, RigidTransform> tartanair_poses(const fs::path& path, SlamMap& map) {
  Eigen::Matrix3d body_from_camera;  // the camera's x is forward, y down, z left
  body_from_camera << 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0;
  std::map<std::int64_t, RigidTransform> poses;
  std::size_t unnormalised = 0;
  TextInput in(path);
  while (in.next()) {
    const auto frame = in.number<std::int64_t>("the frame");
    Eigen::Vector3d position;
    for (double& value : position) value = in.number("the position");
    std::array<double, 4> xyzw{};
    for (double& value : xyzw) value = in.number("the quaternion");
    if (!in.at_end()) in.refuse("has more than 8 numbers, expected frame tx ty tz qx qy qz qw");
    const Eigen::Matrix3d world_from_body = rotation_from_quaternion(xyzw, path, in.here(), unnormalised);
    if (!poses.emplace(frame, RigidTransform{world_from_body * body_from_camera, position}).second) {
      in.refuse("frame " + std::to_string(frame) + " has a second pose, expected one");
    }
  }
  note_unnormalised(map, unnormalised);
  return poses;
}

SlamMap read_tartanair(MapFile& file, const ReadMapOptions& /*options*/) {
  const JsonValue json(file.json(), file.path());
  const fs::path folder = file.path().parent_path();
  SlamMap map;
  map.path = file.path();
  map.format = "TartanAir (COLMAP's benchmark)";
  map.images = folder / "images";
  const JsonValue size = json.at("image_size");
  if (size.size() != 2) size.refuse("width and height");
  camera_of_size(map, size.element(0), size.element(1), file.path());
  const std::map<std::int64_t, RigidTransform> poses = tartanair_poses(folder / "poses.txt", map);
  json.at("frames").each_element([&](const JsonValue& frame) {
    MapKeyframe keyframe;
    keyframe.id = frame.at("source_frame").integer();
    keyframe.image = image_name(frame.at("image_name").text(), map.path, frame.where());
    const auto pose = poses.find(keyframe.id);
    if (pose == poses.end()) frame.at("source_frame").refuse("a frame with a pose in poses.txt");
    keyframe.cam_from_world = pose->second.inverse();
    map.keyframes.push_back(std::move(keyframe));
  });
  return finalize_map(std::move(map));
}

}  // namespace

extern const MapFormat kOb3d, kTartanAir;
const MapFormat kOb3d{"OB3D", "a path of OB3D (directory with cameras/)", is_ob3d, read_ob3d};
const MapFormat kTartanAir{"TartanAir", "scene.json of COLMAP's TartanAir set", is_tartanair, read_tartanair};

}  // namespace pmsp::map_detail
