// SPDX-License-Identifier: BSD-2-Clause
#include "bench_flight.h"

#include <list>
#include <optional>
#include <string>
#include <utility>

#include "pmsp/error.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"
#include "synth/mission.h"

namespace pmsp::bench {

Flight render_flight(int image_width, int keyframes) {
  synth::Recipe recipe;
  recipe.width = image_width;
  recipe.height = image_width / 2;
  recipe.keyframes = keyframes;
  recipe.mission.render.samples = 1;
  const auto mission = std::make_shared<const synth::Mission>(synth::textured_room(recipe));
  Flight flight{{}, mission->width, mission->height, mission};
  for (std::size_t i = 0; i < mission->frames.size(); ++i) flight.keyframes.push_back(synth::keyframe_of(*mission, i));
  return flight;
}

Flight read_flight(const std::filesystem::path& map_file, const std::filesystem::path& folder, int keyframes) {
  const SlamMap map = read_map(map_file);
  const std::unique_ptr<ImageSource> source = open_image_folder(map, folder);
  const auto images = std::make_shared<std::list<Image<Rgb>>>();
  Flight flight;
  ViewFilter filter{ViewFilterOptions{}};
  const std::size_t wanted = static_cast<std::size_t>(keyframes);
  while (flight.keyframes.size() < wanted) {
    std::optional<ImageSource::Item> item = source->next();
    if (!item) break;
    Keyframe keyframe = keyframe_of(map, *map.find_keyframe(item->keyframe_id));
    if (!filter.accept(keyframe)) continue;
    images->push_back(std::move(item->image));
    keyframe.image = std::as_const(images->back()).view();
    flight.keyframes.push_back(std::move(keyframe));
  }
  if (flight.keyframes.size() < wanted) {
    throw InvalidInput(map_file.string() + " with the images in " + folder.string() + ": " +
                       std::to_string(flight.keyframes.size()) + " keyframes can be used, expected at least " +
                       std::to_string(keyframes));
  }
  flight.image_width = images->front().width();
  flight.image_height = images->front().height();
  flight.images = images;
  return flight;
}

}  // namespace pmsp::bench
