// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "pmsp/io/map.h"

namespace pmsp {

Keyframe keyframe_of(const SlamMap& map, const MapKeyframe& in_map) {
  Keyframe keyframe;
  keyframe.id = in_map.id;
  keyframe.timestamp = in_map.timestamp;
  keyframe.cam_from_world = in_map.cam_from_world;
  keyframe.landmarks.reserve(in_map.observations.size());
  for (const MapObservation& observation : in_map.observations) {
    const MapLandmark* landmark = map.find_landmark(observation.landmark_id);
    if (landmark != nullptr) keyframe.landmarks.push_back({landmark->id, landmark->position_world});
  }
  return keyframe;
}

double farthest_landmarks(const SlamMap& map) {
  double farthest = 0.0;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const Eigen::Vector3d center = keyframe.cam_from_world.center();
    std::vector<double> depths;
    for (const Landmark& landmark : keyframe_of(map, keyframe).landmarks) {
      depths.push_back((landmark.position_world - center).norm());
    }
    if (depths.empty()) continue;
    const auto at = depths.begin() + std::lround(0.98 * static_cast<double>(depths.size() - 1));
    std::nth_element(depths.begin(), at, depths.end());
    farthest = std::max(farthest, *at);
  }
  return farthest;
}

}  // namespace pmsp
