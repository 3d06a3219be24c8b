// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/cost.h"

#include <algorithm>

#include "fusion/fusion_setup.h"
#include "rehearsal.h"
#include "schedule.h"
#include "sphere/cube_map.h"

namespace pmsp {
namespace {

/// More keyframes than flights have: later ones find what those before have let go of.
constexpr std::int64_t kLongFlight = std::int64_t{1} << 40;

/// Of images whose width is not known: of the largest that are usual.
double camera_pixels(int width) {
  return width == kAnyImageWidth ? 5760.0 * 2880.0 : static_cast<double>(width) * width / 2.0;
}

double cube_texels(int width) {
  const double side = cube_size_for(width);
  return 6.0 * side * side;
}

/// How many keyframes more have an artefact where several devices share the work: they do a task of each stage at a
/// time, and a stage waits for one keyframe more. What waits for the rest of a mission is dealt out to them.
double keyframes_more(Artefact artefact, const Schedule& schedule, const DensifierOptions& options) {
  const Lifetime* const lifetime = schedule.lifetime(artefact);
  if (options.devices.size() < 2 || lifetime == nullptr) return 0.0;
  std::size_t last = 0;
  for (const Lifetime::Reader& reader : lifetime->readers) last = std::max(last, reader.stage);
  return 2.0 * static_cast<double>(last);
}

}  // namespace

std::size_t device_memory_needed(const DensifierOptions& options, int image_width) {
  const double pixels = static_cast<double>(options.width) * options.height;
  const ImageSize compared = compared_size(image_width, options.width, options.height, options.patchmatch.image_scale);
  const double image =
      (options.devices.size() < 2 ? 2.0 : 4.0) * cube_texels(compared.width) +  // packed for others, too
      cube_texels(options.width);                                               // the mask
  const bool waits_in_file = !options.scratch_folder.empty();
  const bool is_short = options.expected_keyframes > 0 && !options.unordered;  // in a set all wait for all
  const std::int64_t used = is_short ? options.expected_keyframes : kLongFlight;
  const double bytes_of_standings = 2.0 + agree_bytes(options.fusion);

  Rehearsal rehearsal(options);
  const auto with_more = [&](double held, Artefact artefact) {
    const double more = keyframes_more(artefact, rehearsal.schedule(), options);
    return held > 0.0 ? std::max(held, std::min(held + more, static_cast<double>(used))) : 0.0;
  };
  // What keyframes have. Memory of one size is not used again for another.
  double images = 0.0, of16 = 0.0, of8 = 0.0, of4 = 0.0, of1 = 0.0;
  rehearsal.run(used, [&](const Rehearsal::Held& all) {
    const double surfels = waits_in_file ? 0.0 : all.surfels;
    const double range_maps = waits_in_file ? 0.0 : all.range_maps;
    const double planes = with_more(all.planes, Artefact::kPlanes) + with_more(all.medians, Artefact::kMedian);
    const double words = with_more(all.colors, Artefact::kColor) + with_more(all.filtered, Artefact::kFiltered) +
                         3.0 * surfels;  // surfel, details, and who is still to be asked
    images = std::max(images, image * with_more(all.images, Artefact::kImage));
    of16 = std::max(of16, 16.0 * pixels * planes);
    of8 = std::max(of8, 8.0 * pixels * with_more(all.evidence, Artefact::kPlanes));
    of4 = std::max(of4, 4.0 * pixels * words);
    of1 = std::max(of1, pixels * (2.0 * range_maps + bytes_of_standings * surfels));
  });
  double bytes = images + of16 + of8 + of4 + of1;
  if (waits_in_file) {               // copies of what a stage looks at
    constexpr double kOfMost = 6.0;  // of a viewer: range map, surfels and standings; a pool keeps each size apart
    bytes += (kernels::kMaxViewers * kOfMost + 3.0 * 4.0 + bytes_of_standings) * pixels;
  }
  // A stage's own: state, result, and what passes begin with; keys, what the picture tells; masks; what is known of
  // mirrors; gray values.
  const double working = (5.0 * 16.0 + 2.0 * 8.0 + 8.0 + 1.0 + 2.0) * pixels +
                         2.0 * 4.0 * static_cast<double>(compared.width) * compared.height;
  // Depth maps, planes and points on their way down.
  const double copies = (2.0 * 20.0 + 2.0 * 16.0 + 2.0 * 40.0 + 2.0) * pixels;
  const double uploads = 2.0 * (3.0 + 1.0) * std::max(pixels, camera_pixels(image_width));
  return static_cast<std::size_t>(bytes + working + copies + uploads);
}

}  // namespace pmsp
