// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/patchmatch.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "patchmatch/match_setup.h"
#include "pmsp/error.h"
#include "sphere/grid.h"
#include "sphere/panorama_data.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

/// Planes in checkerboard order.
struct Planes {
  explicit Planes(std::size_t size) : x(size, 0.0F), y(size, 0.0F), z(size, 0.0F) {}

  bool empty() const { return x.empty(); }
  cpu::ConstPlaneArrays view() const {
    return empty() ? cpu::ConstPlaneArrays{} : cpu::ConstPlaneArrays{x.data(), y.data(), z.data()};
  }

  std::vector<float> x, y, z;
};

void check_size(const DepthMap* map, int width, int height) {
  if (map == nullptr || map->depth.empty()) return;
  if (map->depth.width() != width || map->depth.height() != height) {
    throw InvalidInput("patchmatch: a depth map is not of the reference's size");
  }
}

void check(const MatchInput& input, const PatchMatchOptions& options) {
  options.validate();
  if (input.reference.panorama == nullptr) throw InvalidInput("patchmatch: no reference panorama");
  const int width = input.reference.panorama->width();
  const int height = input.reference.panorama->height();
  const std::size_t count = input.neighbours.size();
  if (count < 1 || count > static_cast<std::size_t>(kernels::kMaxViews)) {
    throw InvalidInput("patchmatch: " + std::to_string(count) + " neighbours; expected 1 to " +
                       std::to_string(kernels::kMaxViews));
  }
  for (const PosedPanorama& neighbour : input.neighbours) {
    if (neighbour.panorama == nullptr || neighbour.panorama->width() != width ||
        neighbour.panorama->height() != height) {
      throw InvalidInput("patchmatch: a neighbour is missing or not of the reference's size");
    }
  }
  for (const PlaneImage* planes : input.candidates) {
    if (planes->width() != width || planes->height() != height) {
      throw InvalidInput("patchmatch: candidate planes are not of the reference's size");
    }
  }
  if (!input.neighbour_maps.empty() && input.neighbour_maps.size() != count) {
    throw InvalidInput("patchmatch: " + std::to_string(input.neighbour_maps.size()) + " depth maps of " +
                       std::to_string(count) + " neighbours; expected none or one for each");
  }
  if (input.prior != nullptr && (input.prior->width() != width || input.prior->height() != height)) {
    throw InvalidInput("patchmatch: prior planes are not of the reference's size");
  }
  const bool starts_anew = input.start == nullptr || input.start->depth.empty();
  if (!starts_anew && !input.candidates.empty()) {
    throw InvalidInput("patchmatch: candidates belong to a first pass, which has no map to start from");
  }
  if (starts_anew && input.prior != nullptr) {
    throw InvalidInput("patchmatch: prior planes belong to a further pass, which has a map to start from");
  }
  for (const DepthMap* map : input.neighbour_maps) check_size(map, width, height);
  check_size(input.start, width, height);
  if (!(input.range.min >= kMinDepth) || !(input.range.max > input.range.min) || !(input.range.max <= kMaxDepth)) {
    std::ostringstream text;
    text << "patchmatch: the depth range is " << input.range.min << " to " << input.range.max << "; expected "
         << kMinDepth << " <= min < max <= " << kMaxDepth;
    throw InvalidInput(text.str());
  }
  for (const PosedPanorama& neighbour : input.neighbours) {
    const double distance = (neighbour.cam_from_world.center() - input.reference.cam_from_world.center()).norm();
    if (!(distance <= 4e12)) throw InvalidInput("patchmatch: a neighbour is more than 4e12 scene units away");
  }
}

kernels::Matching<kernels::CubeView> matching_for(const MatchInput& input, const PatchMatchOptions& options,
                                                  std::uint64_t seed) {
  const Panorama& reference = *input.reference.panorama;
  auto matching =
      make_matching(reference.data().gray.view(), options, reference.width(), input.range, seed, input.keyframe_id);
  const RigidTransform world_from_ref = input.reference.cam_from_world.inverse();
  for (const PosedPanorama& neighbour : input.neighbours) {
    const Panorama::Data& data = neighbour.panorama->data();
    matching.views[matching.num_views++] = {data.gray.view(),
                                            data.matchable.view(),
                                            to_rigid(neighbour.cam_from_world * world_from_ref),
                                            {nullptr, nullptr, nullptr, 0, 0}};
  }
  return matching;
}

/// The neighbours' depth maps as the views' surfaces point to them.
std::vector<PlaneRows> add_surfaces(const MatchInput& input, const SphereGrid& grid, ThreadPool& pool,
                                    kernels::Matching<kernels::CubeView>& matching) {
  std::vector<PlaneRows> surfaces;
  surfaces.reserve(input.neighbour_maps.size());
  for (std::size_t i = 0; i < input.neighbour_maps.size(); ++i) {
    const DepthMap* map = input.neighbour_maps[i];
    if (map == nullptr || map->depth.empty()) continue;
    surfaces.emplace_back(*map, grid, pool);
    matching.views[i].surface = surfaces.back().view();
  }
  return surfaces;
}

/// Planes of a map; none if it is missing.
Planes to_checkerboard(const DepthMap* map, const SphereGrid& grid, ThreadPool& pool) {
  if (map == nullptr || map->depth.empty()) return Planes(0);
  Planes planes(grid.size());
  pool.for_each(grid.height(), [&](int y) {
    for (int x = 0; x < grid.width(); ++x) {
      if (!(map->depth(x, y) > 0.0F)) continue;
      const kernels::Vec3<float> plane = plane_of_pixel(*map, grid, x, y);
      const std::size_t at = grid.index(x, y);
      planes.x[at] = plane.x;
      planes.y[at] = plane.y;
      planes.z[at] = plane.z;
    }
  });
  return planes;
}

Planes to_checkerboard(const PlaneImage& image, const SphereGrid& grid) {
  Planes planes(grid.size());
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      const std::size_t at = grid.index(x, y);
      planes.x[at] = image(x, y).x();
      planes.y[at] = image(x, y).y();
      planes.z[at] = image(x, y).z();
    }
  }
  return planes;
}

std::vector<float> to_checkerboard(const Image<std::uint8_t>& usable, const SphereGrid& grid) {
  std::vector<float> result(usable.empty() ? 0 : grid.size());
  for (int y = 0; y < grid.height() && !usable.empty(); ++y) {
    for (int x = 0; x < grid.width(); ++x) result[grid.index(x, y)] = usable(x, y) != 0 ? 1.0F : 0.0F;
  }
  return result;
}

DepthMap to_depth_map(const Planes& planes, const std::vector<float>& score, const SphereGrid& grid, ThreadPool& pool) {
  DepthMap map;
  map.depth = Image<float>(grid.width(), grid.height(), 0.0F);
  map.normal = Image<Eigen::Vector3f>(grid.width(), grid.height(), Eigen::Vector3f::Zero());
  map.confidence = Image<float>(grid.width(), grid.height(), 0.0F);
  pool.for_each(grid.height(), [&](int y) {
    for (int x = 0; x < grid.width(); ++x) {
      const std::size_t at = grid.index(x, y);
      const kernels::Vec3<float> plane{planes.x[at], planes.y[at], planes.z[at]};
      const kernels::Vec3<float> bearing =
          kernels::bearing(grid.sin_lon()[x], grid.cos_lon()[x], grid.sin_lat()[y], grid.cos_lat()[y]);
      const float inverse_depth = kernels::dot(plane, bearing);
      if (!(inverse_depth > 0.0F)) continue;
      map.depth(x, y) = 1.0F / inverse_depth;
      map.normal(x, y) = to_eigen(-1.0F * kernels::normalized(plane));
      map.confidence(x, y) = std::clamp(score[at], 0.0F, 1.0F);
    }
  });
  return map;
}

}  // namespace

DepthMap patchmatch(const MatchInput& input, const PatchMatchOptions& options, std::uint64_t seed,
                    const Executor& executor, PatchMatchStats* stats, const std::atomic<bool>* cancel) {
  check(input, options);
  const Panorama& reference = *input.reference.panorama;
  ThreadPool& pool = executor.impl().pool;
  const cpu::RowKernels& rows = executor.impl().rows;
  const SphereGrid grid(reference.width(), reference.height());
  auto matching = matching_for(input, options, seed);
  const std::vector<PlaneRows> surfaces = add_surfaces(input, grid, pool, matching);
  std::vector<Planes> candidates;
  std::vector<cpu::ConstPlaneArrays> candidate_views;
  for (const PlaneImage* image : input.candidates) candidates.push_back(to_checkerboard(*image, grid));
  Planes planes = to_checkerboard(input.start, grid, pool);
  const bool started = !planes.empty();
  if (!started) planes = Planes(grid.size());
  for (const Planes& candidate : candidates) candidate_views.push_back(candidate.view());
  const Planes prior = input.prior != nullptr ? to_checkerboard(*input.prior, grid) : Planes(0);
  const std::vector<float> usable = to_checkerboard(reference.usable(), grid);
  std::vector<float> score(grid.size(), -1.0F);

  const cpu::MatchJob job{matching,
                          grid.tables(),
                          {planes.x.data(), planes.y.data(), planes.z.data(), score.data()},
                          candidate_views.data(),
                          static_cast<int>(candidate_views.size()),
                          prior.view(),
                          usable.empty() ? nullptr : usable.data()};

  const auto cancelled = [&] { return cancel != nullptr && cancel->load(std::memory_order_relaxed); };
  if (!started) pool.for_each(grid.height(), [&](int y) { rows.start_row(job, y); });
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    for (int colour = 0; colour < 2; ++colour) {
      if (cancelled()) return {};
      const bool rescore = started && iteration == 0;
      pool.for_each(grid.height(),
                    [&](int y) { rows.iterate_row(job, y, colour, input.first_iteration + iteration, rescore); });
    }
  }

  DepthMap map = to_depth_map(planes, score, grid, pool);
  map.keyframe_id = input.keyframe_id;
  map.cam_from_world = input.reference.cam_from_world;
  if (stats != nullptr) {
    const auto nonzero = [](const std::vector<float>& values) {
      return std::count_if(values.begin(), values.end(), [](float value) { return value > 0.0F; });
    };
    stats->pixels = usable.empty() ? static_cast<std::int64_t>(grid.size()) : nonzero(usable);
    stats->matched = nonzero(map.depth.pixels());
  }
  return map;
}

}  // namespace pmsp
