// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/fusion.h"

#include <algorithm>
#include <cmath>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "fusion.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Another map of the window, ready for comparison.
struct Other {
  const FusionInput* input = nullptr;
  bool later = false;
  cpu::CompareJob job{};
  Eigen::Matrix3f ref_from_other;
};

kernels::Vec3<float> color_of(const Rgb& c) {
  return {static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
}

std::uint8_t to_byte(float value) { return static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F)); }

class RowFuser {
 public:
  RowFuser(const FusionInput& current, const std::vector<Other>& others, const FusionOptions& options,
           const Executor& executor, const SphereGrid& grid)
      : current_(current), others_(others), options_(options), executor_(executor), grid_(grid) {}

  std::vector<CloudPoint> fuse_row(int y) const {
    const int width = grid_.width();
    std::vector<CompareBuffers> rows;
    rows.reserve(others_.size());
    for (const Other& other : others_) {
      rows.emplace_back(width);
      executor_.impl().rows.compare_row(other.job, y, rows.back().out());
    }
    std::vector<CloudPoint> points;
    for (int x = 0; x < width; ++x) {
      if (current_.map->depth(x, y) <= 0.0F || (*current_.covered)[pixel(x, y)] != 0) continue;
      fuse_pixel(x, y, rows, points);
    }
    return points;
  }

 private:
  std::size_t pixel(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(grid_.width()) + static_cast<std::size_t>(x);
  }

  void fuse_pixel(int x, int y, const std::vector<CompareBuffers>& rows, std::vector<CloudPoint>& points) const {
    const DepthMap& map = *current_.map;
    const float depth = map.depth(x, y);
    const Eigen::Vector3f& normal = map.normal(x, y);
    const float confidence = map.confidence(x, y);
    const float min_cos = static_cast<float>(std::cos(options_.max_normal_deg * kernels::kPi / 180.0));
    const std::size_t column = static_cast<std::size_t>(x);
    if (confidence < static_cast<float>(options_.min_confidence)) return;
    kernels::FusionSums sums;
    sums.add(kernels::fusion_weight(confidence, depth), depth, to_vec3(normal), color_of((*current_.color)(x, y)));
    for (std::size_t i = 0; i < others_.size(); ++i) {
      const float closeness = rows[i].closeness[column];
      if (std::fabs(closeness - 1.0F) > static_cast<float>(options_.max_relative_depth)) continue;
      const Other& other = others_[i];
      const std::size_t at = static_cast<std::size_t>(rows[i].index[column]);
      const Eigen::Vector3f turned = other.ref_from_other * other.input->map->normal.pixels()[at];
      if (turned.dot(normal) < min_cos) continue;
      const float other_depth = other.input->map->depth.pixels()[at];
      if (other.later && other_depth < kernels::kMuchCloser * depth) return;
      sums.add(kernels::fusion_weight(other.input->map->confidence.pixels()[at], other_depth),
               rows[i].implied_depth[column], to_vec3(turned), color_of(other.input->color->pixels()[at]));
    }
    const kernels::Vec3<float> bearing =
        kernels::bearing(grid_.sin_lon()[x], grid_.cos_lon()[x], grid_.sin_lat()[y], grid_.cos_lat()[y]);
    CloudPoint point;
    point.position = (sums.depth / sums.weight) * to_eigen(bearing);
    point.normal = to_eigen(kernels::normalized((1.0F / sums.weight) * sums.normal));
    const kernels::Vec3<float> color = (1.0F / sums.weight) * sums.color;
    point.color = {to_byte(color.x), to_byte(color.y), to_byte(color.z)};
    point.confidence = confidence;
    point.views = static_cast<std::uint8_t>(std::min(sums.views, 255));
    points.push_back(point);
    for (const Other& other : others_) {
      if (other.later) cover(other, to_vec3(point.position));
    }
  }

  /// Marks the pixels of a later map that the point stands for: those of the same surface whose centre lies within the
  /// spacing. Near the poles these are many, since columns crowd there.
  void cover(const Other& other, const kernels::Vec3<float>& point) const {
    const DepthMap& map = *other.input->map;
    const kernels::Vec3<float> p = kernels::transform(other.job.other_from_first, point);
    const float range = std::sqrt(kernels::dot(p, p));
    const float tolerance = static_cast<float>(options_.max_relative_depth) * range;
    kernels::for_each_covered(
        p, static_cast<float>(options_.spacing_px), grid_.cos_lat(), grid_.width(), grid_.height(), [&](int pixel) {
          const std::size_t index = static_cast<std::size_t>(pixel);
          const float depth = map.depth.pixels()[index];
          if (std::fabs(depth - range) > tolerance) return;
          __atomic_store_n(&(*other.input->covered)[index], std::uint8_t{1},
                           __ATOMIC_RELAXED);  // rows run in parallel
        });
  }

  const FusionInput& current_;
  const std::vector<Other>& others_;
  const FusionOptions& options_;
  const Executor& executor_;
  const SphereGrid& grid_;
};

void check(const std::vector<FusionInput>& window) {
  for (const FusionInput& input : window) {
    if (input.map == nullptr || input.color == nullptr || input.covered == nullptr) {
      throw InvalidInput("fuse: a keyframe of the window lacks its depth map, colours or covered pixels");
    }
    const bool fits = same_size(*input.map, *window.front().map) && input.covered->size() == input.map->depth.size() &&
                      input.color->width() == input.map->depth.width() &&
                      input.color->height() == input.map->depth.height();
    if (!fits) throw InvalidInput("fuse: depth maps, colours and covered pixels differ in size");
  }
}

}  // namespace

KeyframeCloud fuse(const std::vector<FusionInput>& window, std::size_t current, const FusionOptions& options,
                   const Executor& executor) {
  options.validate();
  if (current >= window.size()) throw InvalidInput("fuse: the current keyframe is not in the window");
  check(window);
  const DepthMap& map = *window[current].map;
  const SphereGrid grid(map.depth.width(), map.depth.height());
  ThreadPool& pool = executor.impl().pool;
  std::vector<PlaneRows> planes;
  planes.reserve(window.size());  // jobs point into it
  std::vector<Other> others;
  for (std::size_t i = 0; i < window.size(); ++i) {
    if (i == current) continue;
    const RigidTransform other_from_ref = window[i].map->cam_from_world * map.cam_from_world.inverse();
    planes.emplace_back(*window[i].map, grid, pool);
    others.push_back({&window[i],
                      i > current,
                      {grid.tables(), map.depth.pixels().data(), planes.back().view(), to_rigid(other_from_ref)},
                      other_from_ref.rotation.transpose().cast<float>()});
  }
  const RowFuser fuser(window[current], others, options, executor, grid);
  std::vector<std::vector<CloudPoint>> rows(static_cast<std::size_t>(grid.height()));
  pool.for_each(grid.height(), [&](int y) { rows[static_cast<std::size_t>(y)] = fuser.fuse_row(y); });
  KeyframeCloud cloud{map.keyframe_id, map.cam_from_world, {}};
  std::size_t count = 0;
  for (const std::vector<CloudPoint>& row : rows) count += row.size();
  cloud.points.reserve(count);
  for (const std::vector<CloudPoint>& row : rows) cloud.points.insert(cloud.points.end(), row.begin(), row.end());
  return cloud;
}

}  // namespace pmsp
