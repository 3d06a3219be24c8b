// SPDX-License-Identifier: BSD-2-Clause
#include "cost.h"

#include <algorithm>
#include <cmath>

#include "fusion/fusion_setup.h"
#include "memory_simulation.h"
#include "sphere/cube_map.h"

namespace pmsp {
namespace {

/// More keyframes than any sequence has: memory of earlier ones is used again.
constexpr std::int64_t kLongSequence = std::int64_t{1} << 40;

/// Rounds up to pages; smaller arrays share a page with others of their size.
double on_pages(double bytes) {
  constexpr double kPage = 2.0 * 1024.0 * 1024.0;
  return bytes <= kPage / 2.0 ? kPage / std::floor(kPage / bytes) : kPage * std::ceil(bytes / kPage);
}

/// Pixels of camera images; of the largest usual ones if their width is unknown.
double camera_pixels(int width) {
  return width == kAnyImageWidth ? 5760.0 * 2880.0 : static_cast<double>(width) * width / 2.0;
}

double cube_texels(int width) {
  const double side = cube_size_for(width);
  return 6.0 * side * side;
}

}  // namespace

std::size_t device_memory_needed(const DensifierOptions& options, int image_width) {
  const double pixels = static_cast<double>(options.width) * options.height;
  const ImageSize matched =
      matching_size(image_width, options.width, options.height, options.advanced.patchmatch.image_scale);
  const double image = (options.devices.size() < 2 ? 1.0 : 2.0) * on_pages(2.0 * cube_texels(matched.width)) +
                       on_pages(cube_texels(options.width));  // with several devices also packed; the mask
  const bool waits_in_file = !options.scratch_folder.empty();
  const bool is_short =
      options.advanced.expected_keyframes > 0 && !options.unordered;  // unordered keyframes all wait for each other
  const std::int64_t used = is_short ? options.advanced.expected_keyframes : kLongSequence;

  // Maximum number of arrays of 16, 4 and 1 bytes per pixel: memory is used again for arrays of the same size only. A
  // device has its share, and copies of all other data that it reads.
  const double share = 1.0 / static_cast<double>(std::max<std::size_t>(1, options.devices.size()));
  double images = 0.0, of16 = 0.0, of4 = 0.0, of1 = 0.0;
  const double agree = agree_bytes(options.advanced.fusion);
  MemorySimulation(options, options.devices.size() > 1).run(used, [&](const MemorySimulation::Held& all) {
    images = std::max(images, all.images);
    of16 = std::max(of16, all.planes + all.medians);
    double words = all.colors + all.filtered + 2.0 * share * all.evidence;
    double bytes = 0.0;
    if (!waits_in_file) {
      words += (1.0 + share) * all.surfels + share * all.candidates;
      bytes = 2.0 * all.range_maps + (1.0 + share * agree) * all.surfels + share * all.ranked;
    }
    of4 = std::max(of4, words);
    of1 = std::max(of1, bytes);
  });
  if (waits_in_file) {  // copies of a stage's input: a range map, surfels and status of each viewer
    of4 += kernels::kMaxViewers + 3.0;
    of1 += 2.0 * kernels::kMaxViewers + 2.0 + agree;
  }
  // Temporary arrays of a stage.
  of16 += 3.0;  // state and priors of a pass, or medians
  of1 += 1.0;
  const double of8 = 2.0;  // keys
  const double kept = images * image + of16 * on_pages(16.0 * pixels) + of8 * on_pages(8.0 * pixels) +
                      of4 * on_pages(4.0 * pixels) + of1 * on_pages(pixels);
  constexpr double kTables = 16.0 * 1024.0 * 1024.0;  // cells of the plane priors, and lookup tables
  const double gray = 2.0 * on_pages(4.0 * static_cast<double>(matched.width) * matched.height) + pixels;
  // Downloads of depth maps, planes and points.
  const double copies = (2.0 * 20.0 + 2.0 * 16.0 + 2.0 * 40.0 + 2.0) * pixels;
  const double uploads = 2.0 * (3.0 + 1.0) * std::max(pixels, camera_pixels(image_width));
  return static_cast<std::size_t>(kept + kTables + gray + copies + uploads);
}

}  // namespace pmsp
