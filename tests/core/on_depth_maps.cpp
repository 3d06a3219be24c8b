// SPDX-License-Identifier: BSD-2-Clause
#include "core/on_depth_maps.h"

namespace pmsp::test {

PlaneImage image_of(const PlaneMap& planes) {
  PlaneImage image(planes.width(), planes.height(), Eigen::Vector3f::Zero());
  for (std::size_t i = 0; i < image.size(); ++i) {
    image.pixels()[i] = {planes.x.pixels()[i], planes.y.pixels()[i], planes.z.pixels()[i]};
  }
  return image;
}

DepthMap beside_at_depth(const DepthMap& map, double wrapped_pixel, float depth) {
  DepthMap result = map;
  for (float& value : result.depth.pixels()) value = depth;
  result.cam_from_world.translation -= result.cam_from_world.rotation * Eigen::Vector3d(wrapped_pixel, 0.0, 0.0);
  return result;
}

void clear_where_no_depth(DepthMap& map) {
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    if (map.depth.pixels()[i] > 0.0F) continue;
    map.normal.pixels()[i].setZero();
    map.confidence.pixels()[i] = 0.0F;
  }
}

void median_filter(DepthMap& map, const MedianFilterOptions& options, const Executor& executor, FilterStats* stats) {
  const PlaneMap kept = median_filter(plane_map_of(map, executor), options, executor, stats);
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    if (kept.x.pixels()[i] == 0.0F && kept.y.pixels()[i] == 0.0F && kept.z.pixels()[i] == 0.0F) {
      map.depth.pixels()[i] = 0.0F;
    }
  }
  clear_where_no_depth(map);
}

void consistency_filter(DepthMap& map, const std::vector<const DepthMap*>& others,
                        const ConsistencyFilterOptions& options, const Executor& executor, FilterStats* stats) {
  std::vector<PlaneMap> planes;
  for (const DepthMap* other : others) planes.push_back(plane_map_of(*other, executor));
  std::vector<const PlaneMap*> pointers;
  for (const PlaneMap& other : planes) pointers.push_back(&other);
  map.confidence = consistency_filter(plane_map_of(map, executor), pointers, options, executor, stats);
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    if (!(map.confidence.pixels()[i] > 0.0F)) map.depth.pixels()[i] = 0.0F;
  }
  clear_where_no_depth(map);
}

RangeMap range_map(const DepthMap& map, const Executor& executor) {
  return range_map(plane_map_of(map, executor), map.confidence, executor);
}

PlaneImage plane_priors(const DepthMap& map, const Panorama& panorama, const std::vector<KeyframePose>& neighbours,
                        const DepthRange& range, const Executor& executor) {
  return image_of(plane_priors(plane_map_of(map, executor), panorama, neighbours, range, executor));
}

std::vector<KeyframePose> places_around(const KeyframePose& pose) {
  std::vector<KeyframePose> places(3, pose);
  for (int axis = 0; axis < 3; ++axis) {
    places[static_cast<std::size_t>(axis)].cam_from_world.translation[axis] += 1.0 / pose.scale;
  }
  return places;
}

PlaneImage warp_planes(const DepthMap& previous, const KeyframePose& pose, int width, int height,
                       const Executor& executor) {
  return image_of(warp_planes(plane_map_of(previous, executor), pose, width, height, executor));
}

SurfelMap fuse_pixels(const std::vector<FusedDepth>& window, std::size_t current, const FusionOptions& options,
                      const Executor& executor) {
  std::vector<PlaneMap> planes;
  for (const FusedDepth& input : window) planes.push_back(plane_map_of(*input.map, executor));
  std::vector<FusionMap> maps;
  for (std::size_t k = 0; k < window.size(); ++k) {
    maps.push_back({&planes[k], &window[k].map->confidence, window[k].color, window[k].pose});
  }
  return fuse_pixels(maps, current, options, executor);
}

}  // namespace pmsp::test
