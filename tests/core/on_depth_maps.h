// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pmsp/stages.h"

/// The stages on depth maps, in which tests are written: planes go in and come out again. What a filter keeps stays as
/// it is.
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
/// `neighbours`: where the keyframes are that the map is matched with.
PlaneImage plane_priors(const DepthMap& map, const Panorama& panorama, const std::vector<KeyframePose>& neighbours,
                        const DepthRange& range, const Executor& executor);
/// Keyframes beside, above and before another one, so that any texture tells depths.
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

/// `map` as a camera so far beside it, along its x axis, that has everything at one depth.
DepthMap beside_at_depth(const DepthMap& map, double beside, float depth);

/// Restores the rule that normal and confidence are 0 where depth is.
void clear_where_no_depth(DepthMap& map);

}  // namespace pmsp::test
