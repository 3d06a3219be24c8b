// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "map_scene.h"
#include "pmsp/io/map.h"

namespace pmsp::map_detail {

/// How a place in the file is named in messages: by MessagePack keys or by table, row and column.
enum class Dialect { msgpack, sqlite };

struct RawCamera {
  std::string name;
  std::string model;
  std::int64_t cols = 0;
  std::int64_t rows = 0;
  double fps = 0.0;
};

/// A keyframe as the file has it. Of `keyframe`, id, timestamp, source_frame and observations are set; the observations
/// are those with a landmark id >= 0, their pixels as in the file.
struct RawKeyframe {
  MapKeyframe keyframe;
  std::string camera;
  std::array<double, 4> rotation_xyzw{};                  ///< of slam_cam_from_world
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< of slam_cam_from_world
};

/// What the two readers hand over: well-formed, but not yet checked for sense.
struct RawMap {
  std::filesystem::path path;
  Dialect dialect = Dialect::msgpack;
  std::string format;
  std::string keypoint_field;           ///< key or column that the observations' pixels come from, for messages
  bool pixels_in_another_grid = false;  ///< they do not refer to the camera's image and must be projected anew
  std::vector<RawCamera> cameras;
  std::vector<RawKeyframe> keyframes;  ///< any order
  std::vector<MapLandmark> landmarks;  ///< any order
};

/// More keypoints than the pixels of any panorama that was ever mapped (5760 x 2880): a limit for hostile files only.
constexpr std::size_t kMaxKeypoints = std::size_t{1} << 24;

RawMap read_msgpack(const std::filesystem::path& path);
RawMap read_sqlite(const std::filesystem::path& path);

/// Checks values and references, brings poses and pixels to this library's conventions, sorts. Throws InvalidInput.
SlamMap finish_map(RawMap&& raw);

/// `keyframes["12"].ts` or `table keyframes, id 12, column ts`. Id and field may be empty.
std::string place(Dialect dialect, const std::string& section, const std::string& id, const std::string& field);

/// Fills `keyframe.observations` from one landmark id per keypoint; negative ids mean none. The sizes are equal.
template <class Id, class PixelOf>
void set_observations(MapKeyframe& keyframe, const std::vector<Id>& landmark_ids, PixelOf pixel_of) {
  std::size_t count = 0;
  for (const Id id : landmark_ids) count += id >= 0 ? 1 : 0;
  keyframe.observations.reserve(count);
  for (std::size_t i = 0; i < landmark_ids.size(); ++i) {
    if (landmark_ids[i] >= 0) keyframe.observations.push_back({std::int64_t{landmark_ids[i]}, pixel_of(i)});
  }
}

}  // namespace pmsp::map_detail
