// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/fusion.h"

#include <algorithm>
#include <cmath>

#include "cpu/executor_impl.h"
#include "filters/depth_map_tools.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// A later map that sees a surface from less than this share of the distance gets to make its points.
constexpr float kMuchCloser = 0.6F;

/// Another map of the window, ready for comparison.
struct Other {
  const FusionInput* input = nullptr;
  bool later = false;
  cpu::CompareJob job{};
  Eigen::Matrix3f ref_from_other;
};

/// Weighted sums over the maps that agree on a pixel.
struct Sums {
  float weight = 0.0F;
  float depth = 0.0F;
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  int views = 0;

  void add(float w, float d, const Eigen::Vector3f& n, const Rgb& c) {
    weight += w;
    depth += w * d;
    normal += w * n;
    color += w * Eigen::Vector3f(c.r, c.g, c.b);
    ++views;
  }
};

float weight_of(float confidence, float depth) { return std::max(confidence, 0.01F) / (depth * depth); }

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
    Sums sums;
    sums.add(weight_of(confidence, depth), depth, normal, (*current_.color)(x, y));
    for (std::size_t i = 0; i < others_.size(); ++i) {
      const float closeness = rows[i].closeness[column];
      if (std::fabs(closeness - 1.0F) > static_cast<float>(options_.max_relative_depth)) continue;
      const Other& other = others_[i];
      const std::size_t at = static_cast<std::size_t>(rows[i].index[column]);
      const Eigen::Vector3f turned = other.ref_from_other * other.input->map->normal.pixels()[at];
      if (turned.dot(normal) < min_cos) continue;
      const float other_depth = other.input->map->depth.pixels()[at];
      if (other.later && other_depth < kMuchCloser * depth) return;
      sums.add(weight_of(other.input->map->confidence.pixels()[at], other_depth), rows[i].implied_depth[column], turned,
               other.input->color->pixels()[at]);
    }
    const kernels::Vec3<float> bearing =
        kernels::bearing(grid_.sin_lon()[x], grid_.cos_lon()[x], grid_.sin_lat()[y], grid_.cos_lat()[y]);
    CloudPoint point;
    point.position = (sums.depth / sums.weight) * to_eigen(bearing);
    point.normal = sums.normal.normalized();
    const Eigen::Vector3f color = sums.color / sums.weight;
    point.color = {to_byte(color.x()), to_byte(color.y()), to_byte(color.z())};
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
    const int width = grid_.width();
    const float spacing = static_cast<float>(options_.spacing_px);
    const kernels::Vec3<float> p = kernels::transform(other.job.other_from_first, point);
    const float range = std::sqrt(kernels::dot(p, p));
    const auto at = kernels::project(p, static_cast<float>(width), static_cast<float>(grid_.height()));
    const int first_row = std::max(0, static_cast<int>(std::floor(at.y - spacing)));
    const int last_row = std::min(grid_.height() - 1, static_cast<int>(std::floor(at.y + spacing)));
    for (int row = first_row; row <= last_row; ++row) {
      const float dy = static_cast<float>(row) + 0.5F - at.y;
      if (std::fabs(dy) > spacing) continue;
      const float reach = std::min(std::sqrt(spacing * spacing - dy * dy) / grid_.cos_lat()[row],
                                   0.5F * static_cast<float>(width) - 1.0F);
      const int last = static_cast<int>(std::floor(at.x + reach - 0.5F));
      for (int column = static_cast<int>(std::ceil(at.x - reach - 0.5F)); column <= last; ++column) {
        const std::size_t index = pixel((column + width) % width, row);
        const float depth = map.depth.pixels()[index];
        if (std::fabs(depth - range) > static_cast<float>(options_.max_relative_depth) * range) continue;
        __atomic_store_n(&(*other.input->covered)[index], std::uint8_t{1}, __ATOMIC_RELAXED);  // rows run in parallel
      }
    }
  }

  const FusionInput& current_;
  const std::vector<Other>& others_;
  const FusionOptions& options_;
  const Executor& executor_;
  const SphereGrid& grid_;
};

}  // namespace

KeyframeCloud fuse(const std::vector<FusionInput>& window, std::size_t current, const FusionOptions& options,
                   const Executor& executor) {
  options.validate();
  if (current >= window.size()) throw InvalidInput("fuse: the current keyframe is not in the window");
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
  for (const std::vector<CloudPoint>& row : rows) cloud.points.insert(cloud.points.end(), row.begin(), row.end());
  return cloud;
}

}  // namespace pmsp
