// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>

#include "pmsp/stages.h"

namespace pmsp {

DepthRange depth_range(const Keyframe& keyframe, const InitOptions& options) {
  std::vector<double> ranges;
  ranges.reserve(keyframe.landmarks.size());
  for (const Landmark& landmark : keyframe.landmarks) {
    const double range = (keyframe.cam_from_world * landmark.position_world).norm() / keyframe.scale;
    if (is_usable_depth(range)) ranges.push_back(range);
  }
  if (ranges.empty()) return {};
  std::sort(ranges.begin(), ranges.end());
  const auto percentile = [&](double share) {
    return ranges[static_cast<std::size_t>(std::lround(share * static_cast<double>(ranges.size() - 1)))];
  };
  return {std::max(percentile(0.02) / options.range_margin, kMinDepth),
          std::min(percentile(0.98) * options.range_margin, kMaxDepth)};
}

}  // namespace pmsp
