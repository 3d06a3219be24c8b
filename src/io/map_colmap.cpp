// SPDX-License-Identifier: BSD-2-Clause
//
// Reader of COLMAP sparse models (https://colmap.github.io/format.html), text or binary. Poses are cam_from_world with
// the axes of this library; pixel centres are at + 0.5. Rigs and frames (COLMAP >= 3.12) are not read, since images
// contain complete poses. Panoramas: EQUIRECTANGULAR (width, height; COLMAP >= 4.1), SPHERICAL (same, forks), SPHERE
// (f, cx, cy; SphereSfM).
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "binary_input.h"
#include "export/files.h"
#include "map_file.h"
#include "map_scene.h"
#include "pmsp/error.h"
#include "text_input.h"

namespace pmsp::map_detail {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kNoPoint = -1;
constexpr std::size_t kMaxNames = 200;  ///< length from which on a note lists no further camera model [bytes]
constexpr int kSphericalForkId = 16;    ///< id of SPHERICAL in forks (2 parameters); in COLMAP EUCM (6)
constexpr int kSphere = 11;  ///< id of SPHERE in SphereSfM (3 parameters); in COLMAP RAD_TAN_THIN_PRISM_FISHEYE (16)
/// COLMAP's models, by id.
struct CameraModel {
  const char* name;
  int parameters;
};
constexpr std::array<CameraModel, 18> kCameraModels{{{"SIMPLE_PINHOLE", 3},
                                                     {"PINHOLE", 4},
                                                     {"SIMPLE_RADIAL", 4},
                                                     {"RADIAL", 5},
                                                     {"OPENCV", 8},
                                                     {"OPENCV_FISHEYE", 8},
                                                     {"FULL_OPENCV", 12},
                                                     {"FOV", 5},
                                                     {"SIMPLE_RADIAL_FISHEYE", 4},
                                                     {"RADIAL_FISHEYE", 5},
                                                     {"THIN_PRISM_FISHEYE", 12},
                                                     {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                                     {"SIMPLE_DIVISION", 4},
                                                     {"DIVISION", 5},
                                                     {"SIMPLE_FISHEYE", 3},
                                                     {"FISHEYE", 4},
                                                     {"EUCM", 6},
                                                     {"EQUIRECTANGULAR", 2}}};

struct Reconstruction {
  SlamMap map;
  std::map<std::uint32_t, std::optional<int>> cameras;  ///< index into map.cameras; nullopt = not equirectangular
  std::set<std::string> skipped_camera_models;          ///< names of camera models that are not equirectangular
  std::size_t skipped_images = 0;                       ///< number of images with such cameras
  std::size_t unnormalised = 0;                         ///< number of quaternions with a norm other than 1
};

bool is_equirectangular(const std::string& model) {
  return model == "EQUIRECTANGULAR" || model == "SPHERICAL" || model == "SPHERE";
}

void add_camera(Reconstruction& model, std::uint32_t id, const std::string& camera_model, double width, double height,
                const std::vector<double>& parameters, const fs::path& path, const std::string& where) {
  if (model.cameras.count(id) != 0) {
    fail(path, where, "camera " + std::to_string(id) + " appears more than once, expected unique ids");
  }
  if (!is_equirectangular(camera_model)) {
    model.cameras[id] = std::nullopt;
    model.skipped_camera_models.insert(camera_model);
    return;
  }
  const MapCamera camera = equirectangular_camera("camera " + std::to_string(id), width, height, path, where);
  const bool sphere = camera_model == "SPHERE";
  if (parameters.size() != (sphere ? 3U : 2U)) {
    fail(path, where,
         camera_model + " has " + std::to_string(parameters.size()) + " parameters, expected " +
             (sphere ? "3: f, cx, cy" : "2: width and height"));
  }
  const double across = sphere ? 2.0 * parameters[1] : parameters[0];
  const double down = sphere ? 2.0 * parameters[2] : parameters[1];
  if (!(std::abs(across - width) <= 1.0) || !(std::abs(down - height) <= 1.0)) {
    fail(path, where,
         "the parameters of " + camera_model + " belong to a panorama of " + to_message(across) + " x " +
             to_message(down) + " pixels, the camera is " + to_message(width) + " x " + to_message(height) +
             "; expected the same");
  }
  model.cameras[id] = static_cast<int>(model.map.cameras.size());
  model.map.cameras.push_back(camera);
}

/// Converts an image to a keyframe without observations. Returns nullopt if its camera is not equirectangular.
std::optional<MapKeyframe> parse_keyframe(Reconstruction& model, std::uint32_t id, const std::array<double, 4>& wxyz,
                                          const Eigen::Vector3d& translation, std::uint32_t camera,
                                          const std::string& name, const fs::path& path, const std::string& where) {
  const auto found = model.cameras.find(camera);
  if (found == model.cameras.end()) {
    fail(path, where,
         "image " + std::to_string(id) + " names camera " + std::to_string(camera) +
             ", expected one of those in cameras");
  }
  if (!found->second) {
    ++model.skipped_images;
    return std::nullopt;
  }
  MapKeyframe keyframe;
  keyframe.id = id;
  keyframe.camera = *found->second;
  keyframe.image = image_name(name, path, where);
  const std::string what = where + ": image " + std::to_string(id);
  keyframe.cam_from_world.rotation =
      rotation_from_quaternion({wxyz[1], wxyz[2], wxyz[3], wxyz[0]}, path, what, model.unnormalised);
  keyframe.cam_from_world.translation = translation;
  return keyframe;
}

// ---- text

void read_cameras_text(Reconstruction& model, const fs::path& path) {
  TextInput in(path);
  while (in.next()) {
    const auto id = in.number<std::uint32_t>("the camera's id");
    const std::string camera_model(in.word("the camera's model"));
    const auto width = in.number("the width");
    const auto height = in.number("the height");
    std::vector<double> parameters;
    while (!in.at_end()) parameters.push_back(in.number("a parameter"));
    add_camera(model, id, camera_model, width, height, parameters, path, in.here());
  }
}

void read_images_text(Reconstruction& model, const fs::path& path) {
  TextInput in(path);
  while (in.next()) {
    const auto id = in.number<std::uint32_t>("the image's id");
    std::array<double, 4> wxyz{};
    for (double& value : wxyz) value = in.number_or_nan("the quaternion");
    Eigen::Vector3d translation;
    for (double& value : translation) value = in.number_or_nan("the translation");
    const auto camera = in.number<std::uint32_t>("the camera's id");
    const std::string name = in.rest("the image's name");
    std::optional<MapKeyframe> keyframe = parse_keyframe(model, id, wxyz, translation, camera, name, path, in.here());
    if (!in.next_line()) in.refuse("the line with the observations of image " + std::to_string(id) + " is missing");
    while (keyframe && !in.at_end()) {
      const auto x = in.number("an observation's x");
      const auto y = in.number("an observation's y");
      const auto point = in.number<std::int64_t>("an observation's point");
      if (point == kNoPoint) continue;
      keyframe->observations.push_back({point, Eigen::Vector2d(x, y).cast<float>()});
    }
    if (keyframe) model.map.keyframes.push_back(std::move(*keyframe));
  }
}

void read_points_text(Reconstruction& model, const fs::path& path) {
  TextInput in(path);
  while (in.next()) {
    MapLandmark landmark;
    landmark.id = in.number<std::int64_t>("the point's id");
    for (double& value : landmark.position_world) value = in.number_or_nan("the point's position");
    for (int i = 0; i < 3; ++i) in.number<int>("the colour");
    in.word("the point's error");
    while (!in.at_end()) {
      in.number<std::uint32_t>("an image of the track");
      in.number<std::uint32_t>("an observation of the track");
    }
    model.map.landmarks.push_back(landmark);
  }
}

// ---- binary

/// Returns the camera model of an id. Ids that forks and COLMAP use for different models are distinguished by the size
/// of the file, assuming that all cameras have the same model.
CameraModel camera_model_of(int id, BinaryInput& in, std::uint64_t cameras) {
  constexpr std::uint64_t kFixedBytes = 4 + 4 + 8 + 8;
  const std::uint64_t bytes_per_camera = in.size() > 8 && cameras > 0 ? (in.size() - 8) / cameras : 0;
  const auto has_parameters = [&](std::uint64_t count) { return bytes_per_camera == kFixedBytes + 8 * count; };
  if (id == kSphericalForkId && has_parameters(2)) return {"SPHERICAL", 2};
  if (id == kSphere && has_parameters(3)) return {"SPHERE", 3};
  if (id >= 0 && id < static_cast<int>(kCameraModels.size())) return kCameraModels[static_cast<std::size_t>(id)];
  in.refuse("the camera's model is " + std::to_string(id) + ", expected 0 to 17");
}

void read_cameras_binary(Reconstruction& model, const fs::path& path) {
  BinaryInput in(path);
  const std::uint64_t count = in.count("cameras", 24);
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto id = in.number<std::uint32_t>();
    const CameraModel camera_model = camera_model_of(in.number<std::int32_t>(), in, count);
    const auto width = static_cast<double>(in.number<std::uint64_t>());
    const auto height = static_cast<double>(in.number<std::uint64_t>());
    std::vector<double> parameters(static_cast<std::size_t>(camera_model.parameters));
    for (double& value : parameters) value = in.number<double>();
    add_camera(model, id, camera_model.name, width, height, parameters, path, in.here());
  }
  in.expect_end();
}

void read_images_binary(Reconstruction& model, const fs::path& path) {
  BinaryInput in(path);
  const std::uint64_t count = in.count("images", 4 + 7 * 8 + 4 + 1 + 8);
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto id = in.number<std::uint32_t>();
    std::array<double, 4> wxyz{};
    for (double& value : wxyz) value = in.number<double>();
    Eigen::Vector3d translation;
    for (double& value : translation) value = in.number<double>();
    const auto camera = in.number<std::uint32_t>();
    const std::string name = in.text();
    std::optional<MapKeyframe> keyframe = parse_keyframe(model, id, wxyz, translation, camera, name, path, in.here());
    const std::uint64_t observations = in.count("observations", 3 * 8);
    for (std::uint64_t k = 0; k < observations; ++k) {
      const auto x = in.number<double>();
      const auto y = in.number<double>();
      const auto point = in.number<std::int64_t>();
      if (keyframe && point != kNoPoint) {
        keyframe->observations.push_back({point, Eigen::Vector2d(x, y).cast<float>()});
      }
    }
    if (keyframe) model.map.keyframes.push_back(std::move(*keyframe));
  }
  in.expect_end();
}

void read_points_binary(Reconstruction& model, const fs::path& path) {
  BinaryInput in(path);
  const std::uint64_t count = in.count("points", 8 + 3 * 8 + 3 + 8 + 8);
  for (std::uint64_t i = 0; i < count; ++i) {
    MapLandmark landmark;
    landmark.id = in.number<std::int64_t>();
    for (double& value : landmark.position_world) value = in.number<double>();
    in.skip(3 + 8);  // colour, error
    in.skip(in.count("images of a track", 8) * 8);
    model.map.landmarks.push_back(landmark);
  }
  in.expect_end();
}

// ---- folders

/// ".bin" or ".txt"; "" where the folder holds no model.
std::string ending_of_model(const fs::path& folder) {
  for (const char* ending : {".bin", ".txt"}) {
    if (is_file(folder / (std::string("cameras") + ending)) && is_file(folder / (std::string("images") + ending))) {
      return ending;
    }
  }
  return "";
}

/// Returns the directories 0, 1, ... of the mapper's models in `folder` or `folder`/sparse.
std::vector<fs::path> components_in(const fs::path& folder) {
  for (const fs::path& parent : {folder, folder / "sparse"}) {
    std::vector<fs::path> components;
    while (!ending_of_model(parent / std::to_string(components.size())).empty()) {
      components.push_back(parent / std::to_string(components.size()));
    }
    if (!components.empty()) return components;
  }
  return {};
}

bool is_model(MapFile& file) {
  return file.is_folder() && (!ending_of_model(file.path()).empty() || !components_in(file.path()).empty());
}

SlamMap read_model(const fs::path& folder) {
  Reconstruction model;
  const std::string ending = ending_of_model(folder);
  const bool text = ending == ".txt";
  (text ? read_cameras_text : read_cameras_binary)(model, folder / ("cameras" + ending));
  (text ? read_images_text : read_images_binary)(model, folder / ("images" + ending));
  const fs::path points = folder / ("points3D" + ending);
  if (is_file(points)) (text ? read_points_text : read_points_binary)(model, points);
  SlamMap map = std::move(model.map);
  map.path = folder;
  map.format = std::string("COLMAP, ") + (text ? "text" : "binary");
  if (model.skipped_images > 0) {
    std::string names;
    for (const std::string& name : model.skipped_camera_models) {
      if (names.size() < kMaxNames) names += (names.empty() ? "" : ", ") + name;
    }
    map.notes.push_back(
        "images left out, of cameras that are not equirectangular: " + std::to_string(model.skipped_images) + " (" +
        names + "); only panoramas can be used, not views that were cut from them");
  }
  note_unnormalised(map, model.unnormalised);
  return finalize_map(std::move(map));
}

SlamMap read_colmap(MapFile& file, const ReadMapOptions& options) {
  if (!ending_of_model(file.path()).empty()) return read_model(file.path());
  const std::vector<fs::path> folders = components_in(file.path());
  return read_component(folders.size(), file.path(), options, [&](std::size_t i) { return read_model(folders[i]); });
}

}  // namespace

extern const MapFormat kColmap;
const MapFormat kColmap{"COLMAP", "the directory of a model of COLMAP", is_model, read_colmap};

}  // namespace pmsp::map_detail
