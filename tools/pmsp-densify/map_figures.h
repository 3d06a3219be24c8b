// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "pmsp/io/map.h"

namespace pmsp::tool {

/// `percent` from 0 to 100; the nearest value, 0 for none. Reorders `values`.
double percentile(std::vector<double>& values, double percent);

/// Distances from a keyframe to the landmarks that it observes.
std::vector<double> landmark_depths(const SlamMap& map, const MapKeyframe& keyframe);

/// Keyframes in the order of flight: by timestamp, then id.
std::vector<const MapKeyframe*> in_order_of_flight(const SlamMap& map);

}  // namespace pmsp::tool
