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

std::size_t cube_texels(int width) {
  const std::size_t side = static_cast<std::size_t>(cube_size_for(width));
  return 6 * side * side;
}

/// Of one keyframe (see StageEngine). `texels`: of the image as it is compared; the mask's have the size of the pixels.
std::size_t bytes_of(Artefact artefact, const DensifierOptions& options, std::size_t pixels, std::size_t texels) {
  switch (artefact) {
    case Artefact::kImage:
      return (options.devices.size() < 2 ? 2 : 4) * texels + cube_texels(options.width);  // packed for others, too
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

/// How many keyframes more have an artefact where several devices share the work: they do a task of each stage at a
/// time, and a stage waits for one keyframe more. What waits for the rest of a mission is dealt out to them.
std::int64_t keyframes_more(const Lifetime& lifetime, const DensifierOptions& options) {
  const bool waits_long = lifetime.artefact == Artefact::kRangeMap || lifetime.artefact == Artefact::kSurfels;
  if (options.devices.size() < 2 || waits_long) return 0;
  std::size_t last = 0;
  for (const Lifetime::Reader& reader : lifetime.readers) last = std::max(last, reader.stage);
  return 2 * static_cast<std::int64_t>(last);
}

}  // namespace

std::size_t device_memory_needed(const DensifierOptions& options, int image_width) {
  const std::size_t pixels = static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  const ImageSize compared = compared_size(image_width, options.width, options.height, options.patchmatch.image_scale);
  const std::size_t texels = cube_texels(compared.width);
  const Schedule schedule(options, true);
  std::size_t bytes = 0;
  for (const Lifetime& lifetime : schedule.lifetimes()) {
    const std::int64_t keyframes = lifetime.keyframes + keyframes_more(lifetime, options);
    bytes += static_cast<std::size_t>(keyframes) * bytes_of(lifetime.artefact, options, pixels, texels);
  }
  if (!options.scratch_folder.empty()) {  // what waits is there, but for copies of what a stage looks at
    for (const Artefact artefact : {Artefact::kRangeMap, Artefact::kSurfels}) {
      bytes -=
          static_cast<std::size_t>(schedule.keyframes_with(artefact)) * bytes_of(artefact, options, pixels, texels);
    }
    constexpr std::size_t kOfMost = 6;  // of a viewer: range map, surfels and standings; a pool keeps each size apart
    bytes += (kernels::kMaxViewers * kOfMost + bytes_of(Artefact::kSurfels, options, 1, 0)) * pixels;
  }
  // State, warped planes, keys, masks; what is known of mirrors; gray values.
  const std::size_t working = (2 * 16 + 2 * 8 + 1 + 2) * pixels + 2 * 4 * static_cast<std::size_t>(compared.width) *
                                                                      static_cast<std::size_t>(compared.height);
  const std::size_t priors =
      options.patchmatch.geometric_passes > 0 && options.patchmatch.plane_priors ? 16 * pixels : 0;
  const std::size_t copies =
      (2 * 20 + 2 * 16 + 2 * 40 + 2) * pixels;  // depth maps, planes and points on their way down
  const std::size_t uploads = 2 * (3 + 1) * std::max(pixels, kCameraPixels);
  return bytes + working + priors + copies + uploads;
}

}  // namespace pmsp
