// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "equirect.h"
#include "pmsp/camera.h"
#include "pmsp/io/map.h"
#include "util/median_of.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

/// Angle between observation and landmark [rad].
double reprojection_angle(const MapObservation& observation, const MapCamera& camera, const Eigen::Vector3d& point) {
  const Eigen::Vector3d seen = bearing_from_pixel(observation.pixel.cast<double>(), camera.width, camera.height);
  return kernels::angle_between({seen.x(), seen.y(), seen.z()}, {point.x(), point.y(), point.z()});
}

}  // namespace

Keyframe keyframe_of(const SlamMap& map, const MapKeyframe& in_map) {
  Keyframe keyframe;
  keyframe.id = in_map.id;
  keyframe.timestamp = in_map.timestamp;
  keyframe.cam_from_world = in_map.cam_from_world;
  keyframe.landmarks.reserve(in_map.observations.size());
  const MapCamera& camera = map.cameras.at(static_cast<std::size_t>(in_map.camera));
  std::vector<double> reprojection_angles;
  reprojection_angles.reserve(in_map.observations.size());
  for (const MapObservation& observation : in_map.observations) {
    const MapLandmark* landmark = map.find_landmark(observation.landmark_id);
    if (landmark == nullptr) continue;
    keyframe.landmarks.push_back({landmark->id, landmark->position_world});
    const Eigen::Vector3d point = in_map.cam_from_world * landmark->position_world;
    if (point.norm() > 0.0) reprojection_angles.push_back(reprojection_angle(observation, camera, point));
  }
  if (!reprojection_angles.empty())
    keyframe.pose_error =
        std::min(median(reprojection_angles) / std::sqrt(static_cast<double>(reprojection_angles.size())), 1.0);
  return keyframe;
}

double farthest_landmarks(const SlamMap& map) {
  std::vector<double> farthest(map.keyframes.size(), 0.0);
  ThreadPool(0).for_each(static_cast<int>(farthest.size()), [&](int number) {
    const MapKeyframe& keyframe = map.keyframes[static_cast<std::size_t>(number)];
    const Eigen::Vector3d center = keyframe.cam_from_world.center();
    std::vector<double> depths;
    for (const MapObservation& observation : keyframe.observations) {
      const MapLandmark* landmark = map.find_landmark(observation.landmark_id);
      if (landmark != nullptr) depths.push_back((landmark->position_world - center).norm());
    }
    if (depths.empty()) return;
    const auto at = depths.begin() + std::lround(0.98 * static_cast<double>(depths.size() - 1));
    std::nth_element(depths.begin(), at, depths.end());
    farthest[static_cast<std::size_t>(number)] = *at;
  });
  return farthest.empty() ? 0.0 : *std::max_element(farthest.begin(), farthest.end());
}

}  // namespace pmsp
