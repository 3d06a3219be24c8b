// SPDX-License-Identifier: BSD-2-Clause
#include "core/helpers.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "elementary.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

namespace pmsp::test {

synth::Recipe small_recipe(int width, int keyframes) {
  synth::Recipe recipe;
  recipe.width = width;
  recipe.height = width / 2;
  recipe.keyframes = keyframes;
  recipe.mission.landmarks.count = 400;
  recipe.mission.landmarks.min_views = 2;
  recipe.mission.render.samples = 2;
  return recipe;
}

DepthMap match(const synth::Mission& mission, std::size_t reference, const MatchSetup& setup, MatchStats* stats) {
  const Executor executor(setup.threads, setup.simd);
  const Keyframe keyframe = synth::keyframe_of(mission, reference);
  const auto panorama = [&](std::size_t i) {
    const Keyframe other = synth::keyframe_of(mission, i);
    return Panorama(other.image, other.mask, mission.width, mission.height, executor);
  };
  const std::vector<std::size_t> around = {reference - 1, reference + 1};
  const std::vector<std::size_t>& neighbours = setup.neighbours.empty() ? around : setup.neighbours;
  std::vector<Panorama> panoramas;
  panoramas.push_back(panorama(reference));
  for (const std::size_t i : neighbours) panoramas.push_back(panorama(i));
  const PlaneMap sparse = planes_from_landmarks(keyframe, mission.width, mission.height, InitOptions{}, executor);
  MatchInput input;
  input.keyframe_id = keyframe.id;
  input.reference = {&panoramas[0], keyframe.cam_from_world};
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    input.neighbours.push_back({&panoramas[i + 1], mission.frames.at(neighbours[i]).cam_from_world});
  }
  input.range = depth_range(keyframe, InitOptions{});
  const PlaneMap start = setup.start == nullptr ? PlaneMap() : plane_map_of(*setup.start, executor);
  std::vector<PlaneMap> maps;
  for (const DepthMap* map : setup.neighbour_maps) {
    maps.push_back(map == nullptr ? PlaneMap() : plane_map_of(*map, executor));
  }
  for (const PlaneMap& map : maps) input.neighbour_maps.push_back(&map);
  if (setup.start == nullptr) input.landmarks = &sparse;
  input.first_iteration = setup.first_iteration;
  if (setup.start != nullptr) input.start = &start;
  const DepthMap found = depth_map_of(patchmatch(input, setup.options, setup.seed, executor), nullptr, executor);
  if (stats != nullptr) {
    const std::vector<std::uint8_t>& usable = panoramas[0].mask().pixels();
    const std::vector<float>& depths = found.depth.pixels();
    stats->pixels = static_cast<std::int64_t>(depths.size()) - std::count(usable.begin(), usable.end(), 0);
    stats->matched = std::count_if(depths.begin(), depths.end(), [](float depth) { return depth > 0.0F; });
  }
  return found;
}

DepthMap truth_map(const synth::Frame& frame, float confidence) {
  DepthMap map;
  map.keyframe_id = frame.id;
  map.cam_from_world = frame.cam_from_world;
  map.depth = frame.depth;
  map.normal = frame.normal;
  map.confidence = Image<float>(frame.depth.width(), frame.depth.height(), confidence);
  return map;
}

std::vector<DepthMap> truth_maps(const synth::Mission& mission, float confidence) {
  std::vector<DepthMap> maps;
  for (const synth::Frame& frame : mission.frames) maps.push_back(truth_map(frame, confidence));
  return maps;
}

bool same(const Image<float>& a, const Image<float>& b) {
  return a.width() == b.width() && a.height() == b.height() &&
         std::memcmp(a.pixels().data(), b.pixels().data(), a.size() * sizeof(float)) == 0;
}

bool same(const DepthMap& a, const DepthMap& b) {
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "normals are compared as bytes");
  return a.keyframe_id == b.keyframe_id && same(a.depth, b.depth) && same(a.confidence, b.confidence) &&
         a.normal.size() == b.normal.size() &&
         std::memcmp(a.normal.pixels().data(), b.normal.pixels().data(), a.normal.size() * sizeof(Eigen::Vector3f)) ==
             0;
}

double agreement(const Image<float>& a, const Image<float>& b, double relative) {
  std::size_t total = 0;
  std::size_t good = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double first = a.pixels()[i];
    const double second = b.pixels()[i];
    if (first <= 0.0 && second <= 0.0) continue;
    ++total;
    good += first > 0.0 && second > 0.0 && std::abs(first - second) <= relative * second ? 1 : 0;
  }
  return total > 0 ? static_cast<double>(good) / static_cast<double>(total) : 0.0;
}

double normals_within(const DepthMap& map, const synth::Frame& frame, double degrees) {
  const double limit = std::cos(degrees * kernels::kPi / 180.0);
  std::size_t total = 0;
  std::size_t good = 0;
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    if (map.depth.pixels()[i] <= 0.0F) continue;
    ++total;
    good += static_cast<double>(map.normal.pixels()[i].dot(frame.normal.pixels()[i])) >= limit ? 1 : 0;
  }
  return total > 0 ? static_cast<double>(good) / static_cast<double>(total) : 0.0;
}

double filled(const Image<float>& depth) {
  const auto count = std::count_if(depth.pixels().begin(), depth.pixels().end(), [](float d) { return d > 0.0F; });
  return static_cast<double>(count) / static_cast<double>(depth.size());
}

Eigen::Vector3d bearing_of(const Image<float>& depth, int x, int y) {
  return bearing_from_pixel({x + 0.5, y + 0.5}, depth.width(), depth.height());
}

std::vector<std::size_t> look_through_floor(DepthMap& map, const synth::Scene& room, double left, double right,
                                            double deeper) {
  constexpr double kFloor = 1.5;
  const Eigen::Matrix3d to_world = map.cam_from_world.rotation.transpose();
  const Eigen::Vector3d center = map.cam_from_world.center();
  std::vector<std::size_t> pixels;
  for (int y = 0; y < map.depth.height(); ++y) {
    for (int x = 0; x < map.depth.width(); ++x) {
      const Eigen::Vector3d local = bearing_of(map.depth, x, y);
      const Eigen::Vector3d direction = to_world * local;
      const double to_floor = (kFloor - center.y()) / direction.y();
      const Eigen::Vector3d at = center + to_floor * direction;
      if (to_floor <= 0.0 || at.x() < left || at.x() > right || std::abs(at.z()) > 1.5) continue;
      const Eigen::Vector3d up(direction.x(), -direction.y(), direction.z());
      const double beyond = room.intersect(at + 1e-6 * up, up)->distance;
      map.depth(x, y) = static_cast<float>(deeper > 0.0 ? deeper * to_floor : to_floor + beyond);
      map.normal(x, y) = -local.cast<float>();
      pixels.push_back(static_cast<std::size_t>(y) * static_cast<std::size_t>(map.depth.width()) +
                       static_cast<std::size_t>(x));
    }
  }
  return pixels;
}

double degrees_from_motion(const synth::Mission& mission, std::size_t reference, int x, int y) {
  const RigidTransform& pose = mission.frames[reference].cam_from_world;
  const Eigen::Vector3d along =
      mission.frames[reference + 1].cam_from_world.center() - mission.frames[reference - 1].cam_from_world.center();
  const Eigen::Vector3d axis = (pose.rotation * along).normalized();
  const double cosine = std::abs(axis.dot(bearing_from_pixel({x + 0.5, y + 0.5}, mission.width, mission.height)));
  return std::acos(std::min(cosine, 1.0)) * 180.0 / kernels::kPi;
}

std::vector<Simd> available_simd() {
  std::vector<Simd> result;
  for (const Simd simd : {Simd::kScalar, Simd::kAvx2, Simd::kAvx512}) {
    try {
      const Executor executor(1, simd);
      result.push_back(simd);
    } catch (const BackendUnavailable&) {
    }
  }
  return result;
}

}  // namespace pmsp::test
