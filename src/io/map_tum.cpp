// SPDX-License-Identifier: BSD-2-Clause
//
// Trajectories of TUM, EuRoC and KITTI, as SLAM programs write them (see trajectory.h): poses without points and image
// names, used as they are (see docs/input.md).
#include <algorithm>
#include <string>
#include <vector>

#include "map_file.h"
#include "map_scene.h"
#include "trajectory.h"

namespace pmsp::map_detail {
namespace {

bool is_tum(MapFile& file) { return file.is_text() && is_trajectory(file.head()); }

SlamMap read_tum(MapFile& file, const ReadMapOptions& options) {
  Trajectory trajectory = read_trajectory(file.path());
  SlamMap map;
  map.path = file.path();
  map.format = trajectory.format;
  map.ids_are_row_numbers = true;
  map.notes = std::move(trajectory.notes);
  map.cameras.push_back(equirectangular_camera_of_unknown_size());
  for (const TrajectoryPose& pose : trajectory.poses) {
    MapKeyframe keyframe;
    keyframe.timestamp = pose.timestamp;
    if (!trajectory.has_times) keyframe.source_frame = static_cast<std::int64_t>(map.keyframes.size());
    keyframe.cam_from_world = pose.body_from_world;
    map.keyframes.push_back(std::move(keyframe));
  }
  if (!options.camera_from_body.empty()) {
    std::string note;
    const RigidTransform camera_from_body = read_camera_from_body(options.camera_from_body, note);
    for (MapKeyframe& keyframe : map.keyframes) keyframe.cam_from_world = camera_from_body * keyframe.cam_from_world;
    map.notes.push_back(note);
  }
  std::stable_sort(map.keyframes.begin(), map.keyframes.end(),
                   [](const MapKeyframe& a, const MapKeyframe& b) { return a.timestamp < b.timestamp; });
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) map.keyframes[i].id = static_cast<std::int64_t>(i);
  return finalize_map(std::move(map));
}

}  // namespace

extern const MapFormat kTum;
const MapFormat kTum{"TUM", "a trajectory (TUM, EuRoC, VINS, KITTI)", is_tum, read_tum};

}  // namespace pmsp::map_detail
