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

/// Naming of positions in the file for messages: MessagePack keys, or table, row and column.
enum class Dialect { msgpack, sqlite };

struct RawCamera {
  std::string name;
  std::string model;
  std::int64_t cols = 0;
  std::int64_t rows = 0;
  double fps = 0.0;
};

/// Keyframe as in the file. Of `keyframe`, id, timestamp, source_frame and observations are set; observations have a
/// landmark id >= 0 and pixels as in the file.
struct RawKeyframe {
  MapKeyframe keyframe;
  std::string camera;
  std::array<double, 4> rotation_xyzw{};                  ///< of slam_cam_from_world
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< of slam_cam_from_world
};

/// Result of the msgpack and sqlite readers: well-formed, values not yet checked.
struct RawMap {
  std::filesystem::path path;
  Dialect dialect = Dialect::msgpack;
  std::string format;
  std::string keypoint_field;           ///< key or column of the observations' pixels, for messages
  bool pixels_in_another_grid = false;  ///< other grid than the camera's image: to be projected again
  std::vector<RawCamera> cameras;
  std::vector<RawKeyframe> keyframes;  ///< any order
  std::vector<MapLandmark> landmarks;  ///< any order
};

/// Limit for hostile files: more keypoints than the pixels of any mapped panorama (5760 x 2880).
constexpr std::size_t kMaxKeypoints = std::size_t{1} << 24;

RawMap read_msgpack(const std::filesystem::path& path);
RawMap read_sqlite(const std::filesystem::path& path);

/// Checks values and references, converts poses and pixels to the conventions of libpmsp, sorts. Throws InvalidInput.
SlamMap map_from_raw(RawMap&& raw);

/// Returns `keyframes["12"].ts` or `table keyframes, id 12, column ts`. Id and field may be empty.
std::string place(Dialect dialect, const std::string& section, const std::string& id, const std::string& field);

/// Sets `keyframe.observations` from one landmark id per keypoint, negative = none. Sizes are equal.
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
