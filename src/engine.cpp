// SPDX-License-Identifier: BSD-2-Clause
#include "engine.h"

#include <algorithm>

namespace pmsp {

std::vector<const Engine::Frame*> nearest_first(const Engine::Frame& reference,
                                                std::vector<const Engine::Frame*> frames) {
  const Eigen::Vector3d center = reference.pose.cam_from_world.center();
  const auto distance = [&](const Engine::Frame* frame) {
    return (frame->pose.cam_from_world.center() - center).norm();
  };
  std::stable_sort(frames.begin(), frames.end(),
                   [&](const Engine::Frame* a, const Engine::Frame* b) { return distance(a) < distance(b); });
  return frames;
}

}  // namespace pmsp
