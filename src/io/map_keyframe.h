// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/io/map.h"
#include "pmsp/keyframe.h"

namespace pmsp::io {

/// A keyframe of the map as the library takes it, with the landmarks that it observes; image and mask are left out.
inline Keyframe keyframe_of(const SlamMap& map, const MapKeyframe& in_map) {
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

}  // namespace pmsp::io
