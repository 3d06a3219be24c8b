// SPDX-License-Identifier: BSD-2-Clause
//
// OpenSfM's reconstruction.json: an array of reconstructions with cameras, shots and points; observations are in
// tracks.csv beside it. Rotation (angle times axis) and translation of a shot are cam_from_world with the axes of
// libpmsp. Image positions are normalised: (pixel index + 0.5 - size / 2) / larger size.
#include <map>
#include <optional>
#include <string>
#include <unordered_map>

#include <Eigen/Geometry>

#include "map_file.h"
#include "map_scene.h"
#include "text_input.h"

namespace pmsp::map_detail {
namespace {

constexpr std::size_t kMaxWords = 11;  ///< per line of tracks.csv

bool is_reconstruction(const nlohmann::json& json) {
  return json.is_object() && json.contains("shots") && json.contains("cameras");
}

bool is_opensfm(MapFile& file) {
  if (!file.is_json()) return false;
  const nlohmann::json& json = file.json();
  return is_reconstruction(json) || (json.is_array() && !json.empty() && is_reconstruction(json.front()));
}

bool is_panorama(const std::string& projection) { return projection == "spherical" || projection == "equirectangular"; }

Eigen::Matrix3d rotation_of(const JsonValue& value) {
  const Eigen::Vector3d turn = value.vector3();
  if (!turn.allFinite()) return invalid_rotation();
  const double angle = turn.norm();
  const Eigen::Matrix3d rotation =
      angle > 0.0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
  return rotation_from_matrix(rotation, value.path(), value.where());
}

/// Ids of points and tracks: their names if integers, else from 2^40 up in order of occurrence.
class PointIds {
 public:
  std::int64_t of(const std::string& name) {
    const std::optional<std::int64_t> id = plain_number_from<std::int64_t>(name);
    const bool plain = id && *id >= 0 && *id < kFirst && (name.size() == 1 || name[0] != '0');
    if (plain) return *id;
    return others_.emplace(name, kFirst + static_cast<std::int64_t>(others_.size())).first->second;
  }

 private:
  static constexpr std::int64_t kFirst = std::int64_t{1} << 40;
  std::unordered_map<std::string, std::int64_t> others_;
};

/// Adds the observations of tracks.csv to the keyframes; columns: image, track, feature, x, y, others unused.
void read_tracks(SlamMap& map, PointIds& ids, const std::filesystem::path& path) {
  std::unordered_map<std::string, MapKeyframe*> keyframes;
  for (MapKeyframe& keyframe : map.keyframes) keyframes[keyframe.image] = &keyframe;
  std::unordered_map<std::string, MapKeyframe*> of_word;  // by image name in the file; nullptr = no keyframe
  std::unordered_map<std::int64_t, bool> is_point;
  for (const MapLandmark& landmark : map.landmarks) is_point[landmark.id] = true;
  TextInput in(path, '\t');
  while (in.next()) {
    const std::string image(in.word("the image"));
    if (image.rfind("OPENSFM_TRACKS_VERSION", 0) == 0) continue;
    const std::string track(in.word("the track"));
    in.number<std::int64_t>("the feature");
    const auto x = in.number("x");
    const auto y = in.number("y");
    std::size_t words = 5;
    for (; !in.at_end(); ++words) in.number("a value behind x and y");
    if (words > kMaxWords || words < 8) in.refuse("has " + std::to_string(words) + " values, expected 8 to 11");
    auto of_image = of_word.find(image);
    if (of_image == of_word.end()) {
      const auto named = keyframes.find(image_name(image, path, in.here()));
      of_image = of_word.emplace(image, named == keyframes.end() ? nullptr : named->second).first;
    }
    const std::int64_t id = ids.of(track);
    if (of_image->second == nullptr || is_point.count(id) == 0) continue;
    MapKeyframe& keyframe = *of_image->second;
    const MapCamera& camera = map.cameras[static_cast<std::size_t>(keyframe.camera)];
    const Eigen::Vector2d pixel(x * camera.width + 0.5 * camera.width, y * camera.width + 0.5 * camera.height);
    keyframe.observations.push_back({id, pixel.cast<float>()});
  }
}

SlamMap read_one(const JsonValue& json) {
  SlamMap map;
  map.path = json.path();
  map.format = "OpenSfM";
  const std::filesystem::path folder = map.path.parent_path();
  map.images = folder / "images";
  std::map<std::string, int> cameras;  // -1 = not a panorama
  json.at("cameras").each_member([&](const std::string& name, const JsonValue& camera) {
    const std::string projection =
        camera.has("projection_type") ? camera.at("projection_type").text() : std::string("perspective");
    cameras[name] = -1;
    if (!is_panorama(projection)) return;
    cameras[name] = static_cast<int>(map.cameras.size());
    map.cameras.push_back(equirectangular_camera(name, static_cast<double>(camera.at("width").integer()),
                                                 static_cast<double>(camera.at("height").integer()), map.path,
                                                 camera.where()));
  });
  std::size_t others = 0;
  std::size_t timed = 0;
  json.at("shots").each_member([&](const std::string& name, const JsonValue& shot) {
    const auto camera = cameras.find(shot.at("camera").text());
    if (camera == cameras.end()) shot.at("camera").refuse("one of \"cameras\"");
    if (camera->second < 0) {
      ++others;
      return;
    }
    MapKeyframe keyframe;
    keyframe.camera = camera->second;
    keyframe.image = image_name(name, map.path, shot.where());
    keyframe.cam_from_world = {rotation_of(shot.at("rotation")), shot.at("translation").vector3()};
    if (shot.has("capture_time")) keyframe.timestamp = shot.at("capture_time").number();
    timed += keyframe.timestamp > 0.0 ? 1 : 0;
    map.keyframes.push_back(std::move(keyframe));
  });
  if (timed < map.keyframes.size()) {
    for (MapKeyframe& keyframe : map.keyframes) keyframe.timestamp = 0.0;
  }
  note_others(map, "shots left out, of cameras that are not spherical", others);
  number_by_image(map);
  PointIds ids;
  if (json.has("points")) {
    json.at("points").each_member([&](const std::string& name, const JsonValue& point) {
      map.landmarks.push_back({ids.of(name), point.at("coordinates").vector3()});
    });
  }
  const std::filesystem::path tracks = folder / "tracks.csv";
  std::error_code ignored;
  if (std::filesystem::exists(tracks, ignored)) {
    read_tracks(map, ids, tracks);
  } else if (!map.landmarks.empty()) {
    map.notes.push_back("tracks.csv beside it is missing, so that observations of points are unknown");
  }
  return finalize_map(std::move(map));
}

SlamMap read_opensfm(MapFile& file, const ReadMapOptions& options) {
  const JsonValue all(file.json(), file.path());
  if (file.json().is_object()) return read_one(all);
  return read_component(all.size(), file.path(), options, [&](std::size_t i) { return read_one(all.element(i)); });
}

}  // namespace

extern const MapFormat kOpenSfm;
const MapFormat kOpenSfm{"OpenSfM", "reconstruction.json of OpenSfM", is_opensfm, read_opensfm};

}  // namespace pmsp::map_detail
