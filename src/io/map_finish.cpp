// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "map_raw.h"
#include "panorama_size.h"
#include "pmsp/camera.h"
#include "pmsp/types.h"

namespace pmsp::map_detail {
namespace {

template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream out;
  out.precision(10);
  (out << ... << parts);
  return out.str();
}

bool is_panorama(const RawCamera& camera) { return camera.model == "Equirectangular"; }

/// Converts a camera; throws InvalidInput with the field.
MapCamera checked_camera(const RawMap& raw, const RawCamera& camera) {
  const auto reject = [&](const char* field, const std::string& what) {
    if (raw.dialect == Dialect::msgpack) fail(raw.path, place(raw.dialect, "cameras", camera.name, field), what);
    fail(raw.path, "table cameras, name " + in_quotes(camera.name) + ", column " + field, what);
  };
  if (!is_panorama(camera)) {
    reject("model_type", "the camera is " + in_quotes(camera.model) +
                             ", expected \"Equirectangular\": only maps of 360-degree panoramas can be used");
  }
  if (camera.rows <= 0) reject("rows", text("is ", camera.rows, ", expected a number > 0"));
  if (camera.cols <= 0 || camera.cols > kMaxImageWidth) {
    reject("cols", text("is ", camera.cols, ", expected 1 to ", kMaxImageWidth));
  }
  if (camera.rows > kMaxImageWidth || !io::is_panorama_size(camera.cols, camera.rows)) {
    reject("cols", text("is ", camera.cols, " where rows is ", camera.rows,
                        ", expected cols = 2 x rows, within one row: a full panorama"));
  }
  if (!(camera.fps >= 0.0) || !std::isfinite(camera.fps))
    reject("fps", text("is ", camera.fps, ", expected a finite number >= 0"));
  return {camera.name, static_cast<int>(camera.cols), static_cast<int>(camera.rows), camera.fps};
}

std::vector<MapCamera> checked_cameras(const RawMap& raw) {
  std::vector<MapCamera> cameras;
  const bool has_panorama = std::any_of(raw.cameras.begin(), raw.cameras.end(), is_panorama);
  for (const RawCamera& camera : raw.cameras) {
    if (is_panorama(camera) || !has_panorama) cameras.push_back(checked_camera(raw, camera));
  }
  std::sort(cameras.begin(), cameras.end(), [](const MapCamera& a, const MapCamera& b) { return a.name < b.name; });
  for (std::size_t i = 1; i < cameras.size(); ++i) {
    if (cameras[i - 1].name == cameras[i].name) {
      fail(raw.path, "cameras", "two cameras are named " + in_quotes(cameras[i].name) + ", expected unique names");
    }
  }
  return cameras;
}

RigidTransform checked_pose(const RawMap& raw, const RawKeyframe& keyframe, int image_width,
                            std::size_t& unnormalised) {
  const bool msgpack = raw.dialect == Dialect::msgpack;
  const auto where = [&](const char* field) {
    return place(raw.dialect, "keyframes", std::to_string(keyframe.keyframe.id), field);
  };
  const std::array<double, 4>& q = keyframe.rotation_xyzw;
  const std::string where_turned = where(msgpack ? "rot_cw" : "pose_cw");
  const Eigen::Matrix3d rotation = rotation_from_quaternion(q, raw.path, where_turned, unnormalised);
  const Eigen::Vector3d& t = keyframe.translation;
  if (!is_position(t)) {
    fail(raw.path, where(msgpack ? "trans_cw" : "pose_cw"),
         "the translation is " + to_message(t) + ", " + kExpectedPosition);
  }
  return cam_from_slam_cam(image_width) * RigidTransform{rotation, t};
}

/// Drops lost poses and keyframes of other cameras than panoramas, with a note.
void leave_out(RawMap& raw, SlamMap& map) {
  std::vector<RawKeyframe>& keyframes = raw.keyframes;
  const auto poses = std::remove_if(keyframes.begin(), keyframes.end(), [](const RawKeyframe& k) {
    return is_invalid_pose(k.rotation_xyzw) || !k.translation.allFinite();
  });
  note_invalid_poses(map, static_cast<std::size_t>(keyframes.end() - poses));
  if (poses == keyframes.begin() && !keyframes.empty()) {
    fail(raw.path, "keyframes",
         "none of the " + std::to_string(keyframes.size()) + " keyframes has a valid pose; " + map.notes.back());
  }
  keyframes.erase(poses, keyframes.end());
  const auto points = std::remove_if(raw.landmarks.begin(), raw.landmarks.end(),
                                     [](const MapLandmark& l) { return !l.position_world.allFinite(); });
  note_invalid_points(map, static_cast<std::size_t>(raw.landmarks.end() - points));
  if (points == raw.landmarks.begin() && !raw.landmarks.empty()) {
    fail(raw.path, "landmarks",
         "none of the " + std::to_string(raw.landmarks.size()) + " landmarks is at a finite position");
  }
  raw.landmarks.erase(points, raw.landmarks.end());
  const auto is_of_panorama = [&](const RawKeyframe& keyframe) {
    const auto camera = std::find_if(raw.cameras.begin(), raw.cameras.end(),
                                     [&](const RawCamera& c) { return c.name == keyframe.camera; });
    return camera == raw.cameras.end() || is_panorama(*camera);  // missing ones are rejected later
  };
  if (std::none_of(raw.cameras.begin(), raw.cameras.end(), is_panorama)) return;  // rejected later, too
  const auto others = std::stable_partition(keyframes.begin(), keyframes.end(), is_of_panorama);
  note_others(map, "keyframes left out, of cameras that are not equirectangular",
              static_cast<std::size_t>(keyframes.end() - others));
  keyframes.erase(others, keyframes.end());
}

void sort_keyframes(RawMap& raw) {
  std::vector<RawKeyframe>& keyframes = raw.keyframes;
  if (keyframes.empty()) fail(raw.path, "keyframes", "the map holds no keyframe, expected at least one");
  std::sort(keyframes.begin(), keyframes.end(),
            [](const RawKeyframe& a, const RawKeyframe& b) { return a.keyframe.id < b.keyframe.id; });
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const MapKeyframe& keyframe = keyframes[i].keyframe;
    if (i > 0 && keyframes[i - 1].keyframe.id == keyframe.id) {
      fail(raw.path, place(raw.dialect, "keyframes", std::to_string(keyframe.id), ""),
           "this id appears more than once, expected unique ids");
    }
    if (!std::isfinite(keyframe.timestamp)) {
      fail(raw.path, place(raw.dialect, "keyframes", std::to_string(keyframe.id), "ts"),
           text("is ", keyframe.timestamp, ", expected a finite number of seconds"));
    }
  }
}

int camera_index(const RawMap& raw, const std::vector<MapCamera>& cameras, const RawKeyframe& keyframe) {
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == keyframe.camera) return static_cast<int>(i);
  }
  fail(raw.path, place(raw.dialect, "keyframes", std::to_string(keyframe.keyframe.id), "cam"),
       "there is no camera " + in_quotes(keyframe.camera) + ", expected the name of one in cameras");
}

/// Keeps observations of existing landmarks, each landmark once per keyframe, and converts their pixels.
class ObservationFilter {
 public:
  ObservationFilter(const RawMap& raw, SlamMap& map) : raw_(raw), sieve_(map) {}

  void apply(MapKeyframe& keyframe, const MapCamera& camera) {
    sieve_.begin_keyframe();
    std::size_t kept = 0;
    for (MapObservation observation : keyframe.observations) {
      const MapLandmark* const landmark = sieve_.pass(observation.landmark_id);
      if (landmark == nullptr) continue;
      observation.pixel =
          raw_.pixels_in_another_grid ? projected(keyframe, camera, *landmark) : checked(keyframe, camera, observation);
      keyframe.observations[kept++] = observation;
    }
    keyframe.observations.resize(kept);
  }

 private:
  Eigen::Vector2f checked(const MapKeyframe& keyframe, const MapCamera& camera,
                          const MapObservation& observation) const {
    const float x = observation.pixel.x();
    const float y = observation.pixel.y();
    const auto width = static_cast<float>(camera.width);
    const auto height = static_cast<float>(camera.height);
    if (!(x >= -0.5F && x <= width && y >= -0.5F && y <= height)) {  // false for NaN
      fail(raw_.path, place(raw_.dialect, "keyframes", std::to_string(keyframe.id), raw_.keypoint_field),
           text("the keypoint of landmark ", observation.landmark_id, " lies at (", x, ", ", y,
                "), expected a position in the camera's image of ", camera.width, " x ", camera.height, " pixels"));
    }
    return {x + 0.5F, y + 0.5F};
  }

  static Eigen::Vector2f projected(const MapKeyframe& keyframe, const MapCamera& camera, const MapLandmark& landmark) {
    const Eigen::Vector3d point = keyframe.cam_from_world * landmark.position_world;
    if (!(point.norm() > 0.0)) return {0.5F, 0.5F};
    Eigen::Vector2d pixel = pixel_from_bearing(point, camera.width, camera.height);
    pixel.y() += 0.5;  // the vertical half pixel, which no camera rotation absorbs
    return pixel.cast<float>();
  }

  const RawMap& raw_;
  LandmarkFilter sieve_;
};

}  // namespace

SlamMap map_from_raw(RawMap&& raw) {
  SlamMap map;
  leave_out(raw, map);
  sort_keyframes(raw);
  sort_landmarks(raw.landmarks, raw.path, "is ", [&](std::int64_t id, const char* field) {
    return place(raw.dialect, "landmarks", std::to_string(id), field);
  });
  map.path = raw.path;
  map.format = raw.format;
  map.cameras = checked_cameras(raw);
  map.landmarks = std::move(raw.landmarks);
  map.keyframes.reserve(raw.keyframes.size());
  ObservationFilter filter(raw, map);
  std::size_t unnormalised = 0;
  for (RawKeyframe& keyframe : raw.keyframes) {
    MapKeyframe& result = map.keyframes.emplace_back(std::move(keyframe.keyframe));
    keyframe.keyframe.id = result.id;
    result.camera = camera_index(raw, map.cameras, keyframe);
    const MapCamera& camera = map.cameras[static_cast<std::size_t>(result.camera)];
    result.cam_from_world = checked_pose(raw, keyframe, camera.width, unnormalised);
    filter.apply(result, camera);
  }
  note_unnormalised(map, unnormalised);
  round_camera_sizes(map);
  map.component_keyframes = {map.keyframes.size()};
  map.pixel_centers_at_integers = true;
  map.observations_are_measured = !raw.pixels_in_another_grid;
  return map;
}

}  // namespace pmsp::map_detail
