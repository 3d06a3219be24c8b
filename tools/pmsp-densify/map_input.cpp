// SPDX-License-Identifier: BSD-2-Clause
#include "map_input.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "exit_code.h"

namespace pmsp::tool {
namespace {

bool has_images(const Arguments& arguments) { return !arguments.images.empty() || !arguments.video.empty(); }

}  // namespace

SlamMap read_map(const Arguments& arguments) {
  return pmsp::read_map(arguments.map,
                        {arguments.component, arguments.points, arguments.image_list, arguments.camera_from_body});
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
  result.images = read_map(arguments).images;
  if (result.images.empty()) throw UsageError("the images are missing; give --images DIR or --video FILE");
  return result;
}

std::vector<std::string> remarks(const SlamMap& map) {
  std::vector<std::string> all = map.notes;
  if (map.component_keyframes.size() > 1) {
    std::string text = "component " + std::to_string(map.component) + " of " +
                       std::to_string(map.component_keyframes.size()) + "; keyframes of each:";
    for (const std::size_t count : map.component_keyframes) text += " " + std::to_string(count);
    all.insert(all.begin(), text + "; --component N selects one");
  }
  if (!map.observations_are_tested && !map.landmarks.empty()) {
    all.push_back(
        "observations of points are unknown; points are assigned to the keyframes in which no nearer point hides them");
  }
  const bool has_times =
      std::any_of(map.keyframes.begin(), map.keyframes.end(), [](const MapKeyframe& k) { return k.timestamp != 0.0; });
  if (!has_times && map.keyframes.size() > 1) {
    all.push_back("keyframes have no timestamps; they are in the order of their ids, or a set with --unordered");
  }
  return all;
}

}  // namespace pmsp::tool
