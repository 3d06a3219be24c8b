// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pmsp/stages.h"

/// The stages on depth maps, as used in tests: converts to planes and back. Kept depths are unchanged.
namespace pmsp::test {

/// A plane for each pixel; zero = none.
using PlaneImage = Image<Eigen::Vector3f>;
PlaneImage image_of(const PlaneMap& planes);

void median_filter(DepthMap& map, const MedianFilterOptions& options, const Executor& executor,
                   FilterStats* stats = nullptr);
void consistency_filter(DepthMap& map, const std::vector<const DepthMap*>& others,
                        const ConsistencyFilterOptions& options, const Executor& executor,
                        FilterStats* stats = nullptr);
RangeMap range_map(const DepthMap& map, const Executor& executor);
/// `neighbours`: poses of the source views of the map.
PlaneImage plane_priors(const DepthMap& map, const Panorama& panorama, const std::vector<KeyframePose>& neighbours,
                        const DepthRange& range, const Executor& executor);
/// Keyframes beside, above and before another one, so that any texture determines depth.
std::vector<KeyframePose> places_around(const KeyframePose& pose);
PlaneImage warp_planes(const DepthMap& previous, const KeyframePose& pose, int width, int height,
                       const Executor& executor);

struct FusedDepth {
  const DepthMap* map = nullptr;
  const Image<Rgb>* color = nullptr;
  KeyframePose pose;
};
SurfelMap fuse_pixels(const std::vector<FusedDepth>& window, std::size_t current, const FusionOptions& options,
                      const Executor& executor);

/// `map` seen from a camera at this offset along its x axis, with everything at one depth.
DepthMap beside_at_depth(const DepthMap& map, double wrapped_pixel, float depth);

/// Sets normal and confidence to 0 where the depth is 0.
void clear_where_no_depth(DepthMap& map);

}  // namespace pmsp::test
