// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/cost.h"

#include <algorithm>

#include "fusion/fusion_setup.h"
#include "ownership.h"
#include "schedule.h"
#include "sphere/cube_map.h"

namespace pmsp {
namespace {

/// Of the largest images that are usual; those to come are not known when memory is asked for.
constexpr std::size_t kCameraPixels = std::size_t{5760} * 2880;

/// Of one keyframe (see StageEngine); a cube map has 2 + 1 bytes a texel.
std::size_t bytes_of(Artefact artefact, const DensifierOptions& options, std::size_t pixels, std::size_t cube_side) {
  switch (artefact) {
    case Artefact::kImage:
      return 18 * cube_side * cube_side;
    case Artefact::kColor:
      return 4 * pixels;
    case Artefact::kLandmarks:
      return 0;
    case Artefact::kPlanes:
      if (options.patchmatch.geometric_passes == 0) return 16 * pixels;
      return (32 + (options.patchmatch.plane_priors ? 8 : 0)) * pixels;  // what the picture tells, too
    case Artefact::kMedian:
      return 16 * pixels;
    case Artefact::kFiltered:
      return 4 * pixels;
    case Artefact::kRangeMap:
      return 2 * pixels;
    case Artefact::kSurfels:
      return (3 * 4 + 2 + static_cast<std::size_t>(agree_bytes(options.fusion))) * pixels;
  }
  return 0;
}

}  // namespace

std::size_t device_memory_needed(const DensifierOptions& options) {
  const std::size_t pixels = static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  const std::size_t side = static_cast<std::size_t>(cube_size_for(options.width));
  const Schedule schedule(options, true);
  std::size_t bytes = 0;
  for (const Lifetime& lifetime : schedule.lifetimes()) {
    bytes += static_cast<std::size_t>(lifetime.keyframes) * bytes_of(lifetime.artefact, options, pixels, side);
  }
  if (!options.scratch_folder.empty()) {  // what waits is there, but for copies of what a stage looks at
    for (const Artefact artefact : {Artefact::kRangeMap, Artefact::kSurfels}) {
      bytes -= static_cast<std::size_t>(schedule.keyframes_with(artefact)) * bytes_of(artefact, options, pixels, side);
    }
    constexpr std::size_t kOfMost = 6;  // of a viewer: range map, surfels and standings; a pool keeps each size apart
    bytes += (kernels::kMaxViewers * kOfMost + bytes_of(Artefact::kSurfels, options, 1, 0)) * pixels;
  }
  // State, warped planes, keys, gray, masks; what is known of mirrors.
  const std::size_t working = (2 * 16 + 2 * 8 + 2 * 4 + 1 + 2) * pixels;
  const std::size_t priors =
      options.patchmatch.geometric_passes > 0 && options.patchmatch.plane_priors ? 16 * pixels : 0;
  const std::size_t copies = (2 * 20 + 2 * 40 + 2) * pixels;  // depth maps and points on their way down
  const std::size_t uploads = 2 * (3 + 1) * std::max(pixels, kCameraPixels);
  return bytes + working + priors + copies + uploads;
}

}  // namespace pmsp
