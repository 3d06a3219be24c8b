// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "synth/mission.h"

namespace pmsp::synth_tool {

struct SlamMapOptions {
  double fps = 10.0;         ///< of the camera in the map [1/s]
  double scale = 1.0;        ///< map units per unit of the scene
  int loose_keypoints = 40;  ///< keypoints per keyframe without a landmark
  std::uint64_t seed = 1;    ///< of descriptors and loose keypoints
};

/// Encodes the mission as stella_vslam (since 0.3.6) would, in MessagePack, with its pixel convention and poses.
std::vector<std::uint8_t> slam_map(const synth::Mission& mission, const SlamMapOptions& options);

}  // namespace pmsp::synth_tool
