// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "synth/mission.h"

namespace pmsp::synth_tool {

struct SlamMapOptions {
  double fps = 10.0;         ///< written into the camera [1/s]
  double scale = 1.0;        ///< map units per unit of the scene
  int loose_keypoints = 40;  ///< keypoints of each keyframe that belong to no landmark
  std::uint64_t seed = 1;    ///< of the descriptors and the loose keypoints
};

/// The mission as stella_vslam (since 0.3.6) would have stored it, in MessagePack: its pixel convention, its poses.
std::vector<std::uint8_t> slam_map(const synth::Mission& mission, const SlamMapOptions& options);

}  // namespace pmsp::synth_tool
