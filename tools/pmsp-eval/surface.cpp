// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp-eval/image_compare.h"
#include "pmsp-eval/nearest_point.h"
#include "pmsp-eval/parallel.h"
#include "pmsp-eval/statistics.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"

namespace pmsp::eval {
namespace {

constexpr int kNormalReachPx = 3;             // more than one pixel, since ranges are rounded to millimetres
constexpr double kMinCosIncidence = 0.05;     // bounds the spacing of samples at grazing angles
constexpr double kMaxCell = 2e9;              // cell indices have 32 bits
constexpr std::size_t kMergeEvery = 2000000;  // samples pending before a merge; bounds memory

struct Sample {
  std::array<std::int32_t, 3> cell;
  Eigen::Vector3f position;
  Eigen::Vector3f normal;
  float weight;
  float spacing;
};

/// By cell, then by spacing.
bool before(const Sample& a, const Sample& b) { return a.cell != b.cell ? a.cell < b.cell : a.spacing < b.spacing; }

/// Keeps one sample per cell, that with the finest spacing, with the sum of weights.
void merge_cells(std::vector<Sample>& samples) {
  if (samples.empty()) return;
  std::sort(samples.begin(), samples.end(), before);
  std::size_t last = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].cell == samples[last].cell) {
      samples[last].weight += samples[i].weight;
    } else {
      samples[++last] = samples[i];
    }
  }
  samples.resize(last + 1);
}

/// Range map with its points in camera frame.
class RangeView {
 public:
  explicit RangeView(const Image<float>& range) : range_(range) {}

  int width() const { return range_.width(); }
  int height() const { return range_.height(); }
  float range(int x, int y) const { return range_((x + range_.width()) % range_.width(), y); }
  Eigen::Vector3d bearing(int x, int y) const {
    return bearing_from_pixel({x + 0.5, y + 0.5}, range_.width(), range_.height());
  }
  Eigen::Vector3d point(int x, int y) const { return static_cast<double>(range(x, y)) * bearing(x, y); }

  /// Tangent at pixel (x, y) from that of the neighbours at (+-dx, +-dy) with the smaller range difference, so that it
  /// does not cross an edge.
  std::optional<Eigen::Vector3d> tangent(int x, int y, int dx, int dy) const {
    const float ahead_step = step(x, y, x + dx, y + dy);
    const float behind_step = step(x, y, x - dx, y - dy);
    if (std::isinf(ahead_step) && std::isinf(behind_step)) return std::nullopt;
    if (ahead_step <= behind_step) return point(x + dx, y + dy) - point(x, y);
    return point(x, y) - point(x - dx, y - dy);
  }

  std::optional<Eigen::Vector3d> normal(int x, int y) const {
    const auto along = tangent(x, y, columns_within(kNormalReachPx, y, width(), height()), 0);
    const auto down = tangent(x, y, 0, kNormalReachPx);
    if (!along || !down) return std::nullopt;
    const Eigen::Vector3d cross = along->cross(*down);
    const double length = cross.norm();
    if (!(length > 0.0)) return std::nullopt;
    return cross / length;
  }

 private:
  /// Range difference of two pixels; infinite if the second one is unknown or beyond a pole.
  float step(int x, int y, int other_x, int other_y) const {
    if (other_y < 0 || other_y >= height() || !is_range(range(other_x, other_y))) return INFINITY;
    return std::abs(range(other_x, other_y) - range(x, y));
  }

  const Image<float>& range_;
};

std::array<std::int32_t, 3> cell_of(const Eigen::Vector3d& position, double voxel_m) {
  const Eigen::Array3d cell = (position / voxel_m).array().floor();
  if (!(cell.abs().maxCoeff() < kMaxCell)) {
    throw InvalidInput("the true surface reaches too far for a voxel of " + std::to_string(voxel_m) + " m");
  }
  return {static_cast<std::int32_t>(cell.x()), static_cast<std::int32_t>(cell.y()),
          static_cast<std::int32_t>(cell.z())};
}

std::vector<Sample> sample_range_map(const Image<float>& range, const RigidTransform& world_from_cam,
                                     const Eigen::Vector3d& origin, const SurfaceOptions& options) {
  const RangeView view(range);
  std::vector<Sample> samples;
  for (int y = 0; y < range.height(); y += options.stride) {
    const double cos_latitude = row_weight(y, range.height());
    for (int x = 0; x < range.width(); x += options.stride) {
      const float distance = view.range(x, y);
      if (!is_range(distance) || distance >= static_cast<float>(options.max_range_m)) continue;
      const auto normal = view.normal(x, y);
      if (!normal) continue;
      const double cos_incidence = std::abs(normal->dot(view.bearing(x, y)));
      const double spacing =
          distance * (kernels::kPi / range.height()) * options.stride / std::max(cos_incidence, kMinCosIncidence);
      const Eigen::Vector3d position = world_from_cam * view.point(x, y) - origin;
      samples.push_back({cell_of(position, options.voxel_m), position.cast<float>(),
                         (world_from_cam.rotation * *normal).cast<float>(), static_cast<float>(cos_latitude),
                         static_cast<float>(spacing)});
    }
  }
  merge_cells(samples);
  return samples;
}

Surface to_columns(const std::vector<Sample>& samples) {
  Surface surface;
  surface.positions.reserve(samples.size());
  surface.normals.reserve(samples.size());
  surface.weights.reserve(samples.size());
  surface.spacings.reserve(samples.size());
  for (const Sample& sample : samples) {
    surface.positions.push_back(sample.position);
    surface.normals.push_back(sample.normal);
    surface.weights.push_back(sample.weight);
    surface.spacings.push_back(sample.spacing);
  }
  return surface;
}

/// Sets normals and spacings of scanned samples from their neighbours.
void fit_planes(Surface& surface, int threads) {
  constexpr std::size_t kNeighbours = 12;
  constexpr std::size_t kAdjacent = 4;  // on a grid
  surface.normals.resize(surface.positions.size(), Eigen::Vector3f::UnitZ());
  surface.spacings.resize(surface.positions.size(), 0.0F);
  const NearestPoint tree(surface.positions);
  parallel_chunks(surface.positions.size(), kPointsPerTask, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto hits = tree.find_several(surface.positions[i], kNeighbours);
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (const auto& hit : hits) mean += surface.positions[hit.index].cast<double>();
      mean /= static_cast<double>(hits.size());
      Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
      for (const auto& hit : hits) {
        const Eigen::Vector3d offset = surface.positions[hit.index].cast<double>() - mean;
        covariance += offset * offset.transpose();
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
      surface.normals[i] = solver.eigenvectors().col(0).cast<float>();
      surface.spacings[i] = hits[std::min(kAdjacent, hits.size() - 1)].distance;
    }
  });
}

/// One scanned point per cube within max_range_m of the box around the path.
Surface surface_of_scan(const GroundTruth& truth, const SurfaceOptions& options) {
  Eigen::AlignedBox3d box;
  for (const TimedPose& pose : truth.trajectory()) box.extend(pose.world_from_cam.translation - truth.origin());
  box.min().array() -= options.max_range_m;
  box.max().array() += options.max_range_m;
  std::vector<Sample> samples;
  std::size_t merged = 0;
  open_cloud(truth.cloud())->read([&](const OutputPoint* points, std::size_t count) {
    for (const OutputPoint* point = points; point != points + count; ++point) {
      const Eigen::Vector3d position = point->position - truth.origin();
      if (!box.contains(position)) continue;  // also if it is not finite
      samples.push_back(
          {cell_of(position, options.voxel_m), position.cast<float>(), Eigen::Vector3f::Zero(), 0.0F, 0.0F});
    }
    if (samples.size() - merged > kMergeEvery) {
      merge_cells(samples);
      merged = samples.size();
    }
  });
  merge_cells(samples);
  if (samples.empty()) {
    throw InvalidInput(truth.cloud().string() + ": has no point within " + std::to_string(options.max_range_m) +
                       " m of the path, expected a cloud in the frame and unit of the true poses [m]");
  }
  Surface surface;
  for (const Sample& sample : samples) surface.positions.push_back(sample.position);
  fit_planes(surface, options.threads);
  return surface;
}

}  // namespace

Surface build_surface(const GroundTruth& truth, const SurfaceOptions& options) {
  if (!truth.cloud().empty()) return surface_of_scan(truth, options);
  const auto chosen = spread_indices(truth.range_maps().size(), static_cast<std::size_t>(options.max_frames));
  const auto batch = static_cast<std::size_t>(resolve_threads(options.threads));
  std::vector<Sample> samples;
  std::size_t merged = 0;
  // In batches, appended in order, so that results do not depend on thread timing.
  for (std::size_t start = 0; start < chosen.size(); start += batch) {
    std::vector<std::vector<Sample>> parts(std::min(batch, chosen.size() - start));
    parallel_chunks(parts.size(), 1, options.threads, [&](std::size_t begin, std::size_t) {
      const GroundTruth::RangeMap& map = truth.range_maps()[chosen[start + begin]];
      const TimedPose& pose = truth.trajectory()[static_cast<std::size_t>(map.row)];
      parts[begin] = sample_range_map(GroundTruth::load(map), pose.world_from_cam, truth.origin(), options);
    });
    for (const auto& part : parts) samples.insert(samples.end(), part.begin(), part.end());
    if (samples.size() - merged > kMergeEvery) {
      merge_cells(samples);
      merged = samples.size();
    }
  }
  merge_cells(samples);
  if (samples.empty()) {
    throw InvalidInput("the range maps hold no surface nearer than " + std::to_string(options.max_range_m) + " m");
  }
  return to_columns(samples);
}

}  // namespace pmsp::eval
