// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/free_space.h"

#include <algorithm>
#include <cmath>

#include "cpu/executor_impl.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

constexpr int kCell = 2;      ///< pixels of the depth map along a cell's side
constexpr int kChunk = 4096;  ///< points that a thread takes at a time; a multiple of any number of lanes

/// Points of a cloud one coordinate an array, as the kernels read them, with what is said for and against them.
struct Chunk {
  Chunk() : x(kChunk, 1.0F), y(kChunk, 1.0F), z(kChunk, 1.0F), on_surface(kChunk), through(kChunk) {}
  std::vector<float> x, y, z, on_surface, through;
};

}  // namespace

SightMap sight_map(const DepthMap& map, const Executor& executor) {
  const int width = map.depth.width() / kCell;
  const int height = map.depth.height() / kCell;
  SightMap sight{map.keyframe_id, map.cam_from_world, Image<float>(width, height), Image<float>(width, height)};
  executor.impl().pool.for_each(height, [&](int row) {
    for (int y = row * kCell; y < (row + 1) * kCell; ++y) {
      for (int x = 0; x < width * kCell; ++x) {
        const float depth = map.depth(x, y);
        if (depth <= 0.0F) continue;
        float& nearest = sight.nearest(x / kCell, row);
        float& farthest = sight.farthest(x / kCell, row);
        nearest = nearest > 0.0F ? std::min(nearest, depth) : depth;
        farthest = std::max(farthest, depth);
      }
    }
  });
  return sight;
}

void free_space_filter(KeyframeCloud& cloud, const std::vector<const SightMap*>& others,
                       const FreeSpaceOptions& options, const Executor& executor, FilterStats* stats) {
  options.validate();
  const std::size_t before = cloud.points.size();
  if (options.enabled && before > 0 && !others.empty()) {
    const float tolerance = static_cast<float>(options.max_relative_depth);
    const kernels::SightLimits limits{1.0F - static_cast<float>(options.min_relative_gap), 1.0F - tolerance,
                                      1.0F + tolerance};
    std::vector<cpu::SightJob> jobs;
    for (const SightMap* other : others) {
      jobs.push_back({{other->nearest.pixels().data(), other->farthest.pixels().data(), other->nearest.width(),
                       other->nearest.height()},
                      to_rigid(other->cam_from_world * cloud.cam_from_world.inverse()),
                      limits});
    }
    const int chunks = static_cast<int>((before + kChunk - 1) / kChunk);
    std::vector<std::uint8_t> kept(before);
    const float most = static_cast<float>(options.max_contradiction);
    executor.impl().pool.for_each(chunks, [&](int c) {
      const std::size_t first = static_cast<std::size_t>(c) * kChunk;
      const std::size_t count = std::min<std::size_t>(kChunk, before - first);
      Chunk chunk;
      for (std::size_t i = 0; i < count; ++i) {
        const Eigen::Vector3f& position = cloud.points[first + i].position;
        chunk.x[i] = position.x();
        chunk.y[i] = position.y();
        chunk.z[i] = position.z();
        chunk.on_surface[i] = 1.0F / position.squaredNorm();
      }
      const cpu::SightPoints points{chunk.x.data(),          chunk.y.data(),       chunk.z.data(),
                                    chunk.on_surface.data(), chunk.through.data(), kChunk};
      for (const cpu::SightJob& job : jobs) executor.impl().rows.sight_points(job, points);
      for (std::size_t i = 0; i < count; ++i) {
        CloudPoint& point = cloud.points[first + i];
        kept[first + i] = chunk.through[i] <= most * chunk.on_surface[i] ? 1 : 0;
        point.confidence *= chunk.on_surface[i] / (chunk.on_surface[i] + chunk.through[i]);
      }
    });
    std::size_t end = 0;
    for (std::size_t i = 0; i < before; ++i) {
      if (kept[i] != 0) cloud.points[end++] = cloud.points[i];
    }
    cloud.points.resize(end);
  }
  if (stats != nullptr) *stats = {static_cast<std::int64_t>(before), static_cast<std::int64_t>(cloud.points.size())};
}

}  // namespace pmsp
