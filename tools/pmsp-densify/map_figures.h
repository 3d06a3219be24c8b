// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "pmsp/io/map.h"

namespace pmsp::tool {

/// Returns the nearest-rank percentile, `percent` from 0 to 100; 0 if empty. Reorders `values`.
double percentile(std::vector<double>& values, double percent);

/// Returns the distances from a keyframe to its observed landmarks.
std::vector<double> landmark_depths(const SlamMap& map, const MapKeyframe& keyframe);

/// Returns keyframes by timestamp, then id.
std::vector<const MapKeyframe*> in_time_order(const SlamMap& map);

}  // namespace pmsp::tool
