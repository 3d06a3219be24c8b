// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/options.h"
#include "pmsp/panorama.h"
#include "pmsp/plane_map.h"

namespace pmsp {

struct FilterStats {
  std::int64_t before = 0;  ///< pixels with a plane
  std::int64_t after = 0;
};

/// Drops depths that deviate from the median of their 3 x 3 neighbourhood (around the seam and over the poles too) or
/// whose photometric score is too low. What stays keeps its plane; scores below 0 become 0. Throws InvalidOption.
PMSP_API PlaneMap median_filter(const PlaneMap& map, const MedianFilterOptions& options, const Executor& executor,
                                FilterStats* stats = nullptr);

/// Moves depth edges to where the image has them: each pixel that is off by more than 0.5 % takes the plane that gives
/// the weighted median of the depths around it (13 x 13 pixels, every other one; towards the poles wider). Planes count
/// the more the more similar their pixels' colours are, the nearer they are, and the better they match. Pixels without
/// a plane get one, but for those that `panorama`'s mask forbids. `map`: after the median filter. Source: Ma et al.
/// 2013, "Constant time weighted median filtering for stereo matching and beyond". Throws InvalidInput when the sizes
/// differ.
PMSP_API PlaneMap weighted_median_filter(const PlaneMap& map, const Panorama& panorama, const Executor& executor);

/// Drops depths on which fewer than `options.min_views` maps agree, `map` included; where fewer maps are at hand than
/// `options.window`, in proportion, and where the surfaces of some hide the point, as many as could see it (at least
/// one other). Drops also what as much speaks against as for: a map speaks against a depth if its surface lies clearly
/// behind the point, so that it has looked through it. Maps speak with the inverse fourth power of their camera's
/// distance from the point. A depth with others behind it on both sides is that of a thin thing: there a map may show
/// it up to two pixels beside its place. Returns confidences, 0 = dropped. They are made of the expected error (see
/// DepthMap), which grows with the spread of the maps that agree, with the deviation from the planes around, with what
/// a pixel of parallax is worth in depth and with the error of the poses, and falls with the share of maps that agree
/// and with `map`'s photometric score. A point agrees with another map if that map's surface in the point's direction
/// is as far, within `options.max_relative_depth`. Without any other map confidences are the scores. `map`, `others`:
/// after the median filter, `map` with scores_without_priors (plane_priors.h); at most 30 others. `pose_error`: of
/// `map`'s keyframe, see Keyframe. Throws InvalidOption, and InvalidInput when the maps differ in size.
PMSP_API Image<float> consistency_filter(const PlaneMap& map, const std::vector<const PlaneMap*>& others,
                                         const ConsistencyFilterOptions& options, const Executor& executor,
                                         FilterStats* stats = nullptr, double pose_error = 0.0);

}  // namespace pmsp
