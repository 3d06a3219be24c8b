// SPDX-License-Identifier: BSD-2-Clause
#include "map_figures.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace pmsp::tool {

double percentile(std::vector<double>& values, double percent) {
  if (values.empty()) return 0.0;
  const auto last = static_cast<double>(values.size() - 1);
  const auto at = static_cast<std::ptrdiff_t>(std::lround(last * std::clamp(percent / 100.0, 0.0, 1.0)));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

std::vector<double> landmark_depths(const SlamMap& map, const MapKeyframe& keyframe) {
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  std::vector<double> depths;
  depths.reserve(keyframe.observations.size());
  for (const MapObservation& observation : keyframe.observations) {
    const MapLandmark* landmark = map.find_landmark(observation.landmark_id);
    if (landmark != nullptr) depths.push_back((landmark->position_world - center).norm());
  }
  return depths;
}

std::vector<const MapKeyframe*> in_time_order(const SlamMap& map) {
  std::vector<const MapKeyframe*> keyframes;
  for (const MapKeyframe& keyframe : map.keyframes) keyframes.push_back(&keyframe);
  std::stable_sort(keyframes.begin(), keyframes.end(),
                   [](const MapKeyframe* a, const MapKeyframe* b) { return a->timestamp < b->timestamp; });
  return keyframes;
}

}  // namespace pmsp::tool
