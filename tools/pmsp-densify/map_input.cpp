// SPDX-License-Identifier: BSD-2-Clause
#include "map_input.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <system_error>

#include "decoder.h"
#include "exit_code.h"
#include "image_input.h"
#include "pmsp/error.h"
#include "pmsp/executor.h"
#include "pmsp/io/landmark_sweep.h"
#include "pmsp/io/mask.h"

namespace pmsp::tool {

namespace {

SlamMap read_unproven(const Arguments& arguments) {
  return pmsp::read_map(arguments.map, {arguments.component, arguments.points, arguments.image_list});
}

bool has_images(const Arguments& arguments) { return !arguments.images.empty() || !arguments.video.empty(); }

}  // namespace

SlamMap read_map(const Arguments& arguments, ConventionCheck* proof) {
  SlamMap map = read_unproven(arguments);
  if (arguments.no_verify || arguments.verb == Verb::kMerge) return map;
  const ConventionCheck check = require_convention(map);
  if (!check.remark.empty()) map.notes.push_back(check.remark);
  if (proof != nullptr) *proof = check;
  return map;
}

Arguments with_images(const Arguments& arguments, const SlamMap& map) {
  Arguments result = arguments;
  std::error_code ignored;
  if (!has_images(arguments) && std::filesystem::is_directory(map.images, ignored)) result.images = map.images;
  return result;
}

Arguments with_needed_images(const Arguments& arguments) {
  if (has_images(arguments)) return arguments;
  Arguments result = arguments;
  result.images = read_unproven(arguments).images;
  if (result.images.empty()) throw UsageError("the images are missing; give --images DIR or --video FILE");
  return result;
}

std::string sweep_landmarks(SlamMap& map, const Arguments& arguments, int threads) {
  if (!map.landmarks.empty()) return "";
  const std::unique_ptr<ImageSource> source = open_images(arguments, map);
  ImageReader images(*source, map, threads > 0 ? threads : usable_cpus(), nullptr);
  MaskSource masks = open_masks(arguments);
  LandmarkSweep sweep(map);
  images.each([&](const Keyframe& keyframe) {
    sweep.add(keyframe.id, keyframe.image,
              masks.mask_for(source->origin(keyframe.id).file, keyframe.image.width, keyframe.image.height));
  });
  const LandmarkSweep::Result result = sweep.make_landmarks(map, threads, !arguments.no_verify);
  const auto percent = [](double share) { return std::to_string(std::lround(100.0 * share)) + " %"; };
  if (!result.fits_better.empty()) {
    throw InvalidInput(map.path.string() +
                       ": the images fit another convention of its poses clearly better: " + result.fits_better + ", " +
                       percent(result.better_share) + " of the patches are found instead of " + percent(result.share) +
                       "; put that right where the file was written, a cloud of it would be wrong");
  }
  return "landmarks: " + std::to_string(result.landmarks) + " made from the images, the map has none (" +
         percent(result.share) + " of " + std::to_string(result.patches) + " patches are found at one depth)";
}

std::vector<std::string> remarks(const SlamMap& map) {
  std::vector<std::string> all = map.notes;
  if (map.component_keyframes.size() > 1) {
    std::string text = "component " + std::to_string(map.component) + " of " +
                       std::to_string(map.component_keyframes.size()) + "; keyframes of each:";
    for (const std::size_t count : map.component_keyframes) text += " " + std::to_string(count);
    all.insert(all.begin(), text + "; --component chooses");
  }
  if (!map.observations_are_tested && !map.landmarks.empty()) {
    all.push_back("nothing says which keyframe sees which point; each is given those that nothing nearer hides");
  }
  const bool has_times =
      std::any_of(map.keyframes.begin(), map.keyframes.end(), [](const MapKeyframe& k) { return k.timestamp != 0.0; });
  if (!has_times && map.keyframes.size() > 1) {
    all.push_back("keyframes have no times; they are taken in the order of their ids, or --unordered as a set");
  }
  return all;
}

}  // namespace pmsp::tool
