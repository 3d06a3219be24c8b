// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/initialiser.h"
#include "pmsp/options.h"
#include "pmsp/panorama.h"
#include "pmsp/plane_map.h"
#include "pmsp/transform.h"

namespace pmsp {

/// A posed panorama. The pointers are not owned.
struct PosedPanorama {
  const Panorama* panorama = nullptr;
  KeyframePose pose;
};

/// What a depth map is made from. A first pass knows images only; in a further one, `start` and `neighbour_maps` are
/// what the pass before found, and planes score higher that agree with the neighbours' depth maps.
struct MatchInput {
  std::int64_t keyframe_id = 0;  ///< names the random numbers
  PosedPanorama reference;
  std::vector<PosedPanorama> neighbours;  ///< 1 to 8, of the reference's size, from other places
  DepthRange range;                       ///< [reference's unit]
  const PlaneMap* landmarks = nullptr;    ///< planes to try besides the random ones, of the reference's size
  const PlaneMap* warped = nullptr;       ///< likewise
  int first_iteration = 0;                ///< iterations of the passes before
  const PlaneMap* start = nullptr;        ///< the reference's own map; nullptr = random planes
  /// Planes of surfaces without texture (plane_priors), proposed and preferred there; nullptr = none.
  const PlaneMap* prior = nullptr;
  std::vector<const PlaneMap*> neighbour_maps = {};  ///< none, or one for each neighbour (nullptr or empty = not known)
};

/// Red-black PatchMatch on the sphere (Barnes et al. 2009; Galliani et al. 2015; Surmann et al. 2022): finds for each
/// unmasked pixel of the reference a plane under which its patch looks alike in the neighbours. Its score is the
/// photometric one (NCC, -1 to 1), less what the neighbours' depth maps have against it, and more by up to
/// 0.3 where it agrees with a prior. `seed` and the keyframe's id determine all random numbers. When
/// `cancel` becomes true, returns early with an empty map. Throws InvalidInput and InvalidOption.
PMSP_API PlaneMap patchmatch(const MatchInput& input, const PatchMatchOptions& options, std::uint64_t seed,
                             const Executor& executor, const std::atomic<bool>* cancel = nullptr);

}  // namespace pmsp
