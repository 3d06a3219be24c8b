// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/options.h"
#include "pmsp/plane_map.h"
#include "pmsp/point_cloud.h"
#include "pmsp/range_map.h"
#include "pmsp/transform.h"

/// Points of many keyframes without floaters and without duplicates, in three steps that each look at stated keyframes
/// only and know no order: each pixel's point is made (`fuse_pixels`), those that others have looked through go
/// (`judge`), and of those that show the same place one stays (`ownership_round`). Poses and scales are arguments, so
/// that after a loop closure the last two can be asked again without matching.
namespace pmsp {

/// A keyframe's map on its way through fusion; its images have one size.
struct FusionMap {
  const PlaneMap* map = nullptr;             ///< its own pose is not looked at
  const Image<float>* confidence = nullptr;  ///< from the consistency filter, 0 = no depth
  const Image<Rgb>* color = nullptr;
  KeyframePose pose;
};

/// The points of a keyframe's pixels, and all that is kept of the keyframe until it is known which of them stay: with
/// windows of up to 9 maps 10 bytes a pixel (up to 17: 11), of which others read the first five. Encoded as
/// kernels/surfel.h says.
struct SurfelMap {
  std::int64_t keyframe_id = 0;
  Image<std::uint32_t> surfels;          ///< depth (to 0.013 %) and normal (2 degrees); 0 = no point
  Image<std::uint8_t> standings;         ///< confidence, and whether the pixel makes a point; so far all do
  Image<std::uint32_t> details;          ///< colour, confidence in the keyframe's own map, the rest of the normal
  std::vector<std::uint8_t> agree;       ///< `agree_bytes()` for each pixel, the lowest first; bit k: window_ids[k]
  std::vector<std::int64_t> window_ids;  ///< keyframe ids of the other maps
  int agree_bytes() const { return static_cast<int>((window_ids.size() + 7) / 8); }
};

/// Makes a point of each pixel of `window[current]` whose confidence is at least `options.min_confidence`, and that
/// gives way to none around (`options.suppression`): depth, normal and colour are averages over the maps that agree,
/// weighted with the inverse square of their expected errors (confidence, times the distance). `window`: 33 maps at
/// most, of one size. Throws InvalidOption, and InvalidInput when sizes differ, something is missing, a scale is out of
/// range or `current` is not in the window.
PMSP_API SurfelMap fuse_pixels(const std::vector<FusionMap>& window, std::size_t current, const FusionOptions& options,
                               const Executor& executor);

/// A keyframe that is asked about another one's points.
struct RangeMapFrom {
  const RangeMap* ranges = nullptr;  ///< its own pose is not looked at
  KeyframePose pose;
};

/// Removes floaters: points that other keyframes have looked through. Each viewer has the point on its surface (within
/// `max_relative_depth`), or has seen a surface behind it (farther than `min_relative_gap` behind), or has no say. Both
/// sides are added up, each keyframe with the inverse fourth power of its distance from the point, the point's own one
/// among those that confirm; a point stays while what speaks against it is at most `max_contradiction` of what speaks
/// for it. What stays has its confidence scaled by the share that speaks for it. What mirrors show goes as well
/// (kernels/mirror.h).
///
/// Returns the standings: points that stay are open, the others make no point. May be asked again at any time, with
/// other poses. `viewers`: of the same size; a plan (pmsp/plan.h) says which are worth it. Throws InvalidOption,
/// InvalidInput.
PMSP_API Image<std::uint8_t> judge(const SurfelMap& map, const KeyframePose& pose,
                                   const std::vector<RangeMapFrom>& viewers, const FreeSpaceOptions& options,
                                   const Executor& executor);

/// A keyframe's points and what has been decided of them so far.
struct SurfelsFrom {
  const SurfelMap* map = nullptr;                  ///< its own standings are not looked at
  const Image<std::uint8_t>* standings = nullptr;  ///< from fuse_pixels, judge or a round
  KeyframePose pose;
};

/// One round that decides which pixels of `reference` make a point. A pixel asks for eligible ones of the viewers that
/// show the same side of the same surface within `options.spacing_px` of its own pixels and come first in the order:
/// finer sampling (by octaves), higher confidence, smaller keyframe id. Where one of these is known to make a point the
/// pixel makes none; where there is none left that may, it makes one; else it stays open. What is open after the last
/// round makes a point. (Rounds as in Luby 1986, with this order in place of random numbers.)
///
/// Returns the standings after the round. All standings that go in are those after the round before. `asked`: empty
/// before the first round; of each pixel that is open then, in row order, bit k: viewers[k] may still own its place.
/// `viewers`: 32 at most, in each round the same ones in the same order; those without a map are not asked. Throws
/// InvalidOption, and InvalidInput also where `asked` does not go with the standings.
PMSP_API Image<std::uint8_t> ownership_round(const SurfelsFrom& reference, std::vector<std::uint32_t>& asked,
                                             const std::vector<SurfelsFrom>& viewers, const FusionOptions& options,
                                             const Executor& executor);

/// The points that a keyframe makes, in the order of its pixels, with their keys. Needs all of the map.
PMSP_API KeyframeCloud owned_points(const SurfelsFrom& points);

}  // namespace pmsp
