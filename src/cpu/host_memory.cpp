// SPDX-License-Identifier: BSD-2-Clause
#include "cost.h"

#include <algorithm>

#include "fusion/fusion_setup.h"
#include "memory_simulation.h"
#include "sphere/cube_map.h"

namespace pmsp {
namespace {

constexpr double kPlanes = 16.0;  // bytes per pixel: x, y, z and score

/// Texels of a prepared image, of 8 bytes in a cube map for matching, of 2 in a packed one.
double texels_of(const DensifierOptions& options, int image_width) {
  const double side = cube_size_for(
      matching_size(image_width, options.width, options.height, options.advanced.patchmatch.image_scale).width);
  return 6.0 * side * side;
}

/// Bytes per pixel: point, status of two rounds, window, and candidates of duplicates.
double surfel_of(const DensifierOptions& options) {
  return 2.0 * 4.0 + 2.0 + agree_bytes(options.advanced.fusion) + 4.0;
}

}  // namespace

double keyframe_memory(const DensifierOptions& options, int image_width) {
  const double pixels = static_cast<double>(options.width) * options.height;
  const double each = 4.0 + kPlanes + 4.0 + 2.0 + surfel_of(options);  // color, planes, confidence, range map
  return 8.0 * texels_of(options, image_width) + each * pixels;
}

HostMemory host_memory_needed(const DensifierOptions& options, std::int64_t used, int image_width) {
  const double pixels = static_cast<double>(options.width) * options.height;
  const double texels = texels_of(options, image_width);
  const double surfel = surfel_of(options);
  const bool waits_in_file = !options.scratch_folder.empty();

  HostMemory needed;
  // Temporary memory of a stage: planes of a pass and keys, or data read from the file, and points for output.
  const double matching = (4.0 * kPlanes + 2.0 * 8.0) * pixels;
  const double asking = (waits_in_file ? 5.0 * options.advanced.free_space.views : 0.0) * pixels;
  constexpr double kMirrors = 2.0;         // two words per cell of four pixels
  const double cube_nodes = 8.0 * texels;  // of the last image
  needed.memory = std::max(matching, asking + (20.0 + kMirrors) * pixels) + cube_nodes;
  if (options.unordered) {  // all results wait for all keyframes
    const double each = pixels * (4.0 + 2.0 * kPlanes + kPlanes + 4.0 + 2.0 + surfel);
    (waits_in_file ? needed.scratch : needed.memory) += static_cast<double>(used) * (each + 2.0 * texels);
    return needed;
  }
  double most_held = 0.0;
  MemorySimulation(options).run(used, [&](const MemorySimulation::Held& all) {
    const double waiting = pixels * (2.0 * all.range_maps + surfel * all.surfels);
    const double held = 8.0 * texels * all.images + pixels * (4.0 * all.colors + kPlanes * (all.planes + all.medians) +
                                                              8.0 * all.evidence + 4.0 * all.filtered);
    most_held = std::max(most_held, held + (waits_in_file ? 0.0 : waiting));
    needed.scratch = std::max(needed.scratch, waits_in_file ? waiting : 0.0);
  });
  needed.memory += most_held;
  return needed;
}

}  // namespace pmsp
