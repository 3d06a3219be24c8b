// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/cloud_measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "pmsp-eval/nearest_point.h"
#include "pmsp-eval/parallel.h"
#include "pmsp-eval/statistics.h"
#include "pmsp/error.h"

namespace pmsp::eval {
namespace {

constexpr float kMinCameraDistance = 1e-3F;

/// Distances of a point [m].
struct PointError {
  float plane = 0.0F;
  float point = 0.0F;
  float camera = 0.0F;  ///< to the nearest keyframe
};

/// Surface sample with its distance to the cloud [m].
struct Coverage {
  float cloud = 0.0F;  ///< infinite = no point within the largest threshold
  float camera = 0.0F;
  float weight = 0.0F;
};

/// Returns a uniformly random subset of `count` indices below `size`, ascending; all for count 0 or >= size. Own
/// implementation, since distributions differ between standard libraries.
std::vector<std::uint32_t> draw(std::size_t size, std::size_t count, std::uint64_t seed) {
  if (count == 0 || count > size) count = size;
  std::vector<std::uint32_t> chosen;
  chosen.reserve(count);
  std::mt19937_64 random(seed);
  for (std::size_t i = 0; i < size && chosen.size() < count; ++i) {
    if (random() % (size - i) < count - chosen.size()) chosen.push_back(static_cast<std::uint32_t>(i));
  }
  return chosen;
}

std::vector<Eigen::Vector3f> centers_of(const std::vector<TimedPose>& keyframes) {
  std::vector<Eigen::Vector3f> centers;
  centers.reserve(keyframes.size());
  for (const TimedPose& keyframe : keyframes) centers.emplace_back(keyframe.world_from_cam.translation.cast<float>());
  return centers;
}

std::vector<PointError> measure_points(const AlignedCloud& cloud, const Surface& surface, const NearestPoint& cameras,
                                       const CloudMeasureOptions& options) {
  const NearestPoint tree(surface.positions);
  const auto chosen = draw(cloud.points.size(), options.max_points, options.seed);
  std::vector<PointError> errors(chosen.size());
  parallel_chunks(chosen.size(), kPointsPerTask, options.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3f& point = cloud.points[chosen[i]];
      const auto hit = tree.find(point);
      const auto camera = cameras.find(point);
      if (!hit || !camera) {  // squared distance exceeds float32
        errors[i] = {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
                     kMinCameraDistance};
        continue;
      }
      const Eigen::Vector3f offset = point - surface.positions[hit->index];
      const float along = std::abs(offset.dot(surface.normals[hit->index]));
      const float aside = std::sqrt(std::max(hit->distance * hit->distance - along * along, 0.0F));
      const float reach = std::max(1.5F * surface.spacings[hit->index], 2.0F * static_cast<float>(options.voxel_m));
      errors[i] = {aside <= reach ? along : hit->distance, hit->distance,
                   std::max(camera->distance, kMinCameraDistance)};
    }
  });
  return errors;
}

float largest_threshold(const CloudMeasureOptions& options) {
  double largest = 0.0;
  for (const double t : options.absolute_m) largest = std::max(largest, t);
  for (const double t : options.relative) largest = std::max(largest, t * options.max_range_m);
  return static_cast<float>(largest * 1.001);  // includes distances equal to the threshold
}

std::vector<Coverage> measure_coverage(const AlignedCloud& cloud, const Surface& surface, const NearestPoint& cameras,
                                       const CloudMeasureOptions& options, std::size_t& in_range) {
  std::vector<Coverage> samples(surface.positions.size());
  parallel_chunks(samples.size(), kPointsPerTask, options.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto camera = cameras.find(surface.positions[i], static_cast<float>(options.max_range_m));
      const float weight = surface.weights.empty() ? 1.0F : surface.weights[i];
      if (camera) samples[i] = {std::numeric_limits<float>::infinity(), camera->distance, weight};
    }
  });
  std::vector<std::uint32_t> kept;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (samples[i].weight > 0.0F) kept.push_back(static_cast<std::uint32_t>(i));
  }
  in_range = kept.size();
  if (kept.empty()) {
    throw InvalidInput("no true surface lies within " + std::to_string(options.max_range_m) +
                       " m of a keyframe; raise --max-range, or check that map and truth belong together");
  }
  const auto chosen = draw(kept.size(), options.max_truth, options.seed + 1);
  const NearestPoint tree(cloud.points);
  const float reach = largest_threshold(options);
  std::vector<Coverage> result(chosen.size());
  parallel_chunks(chosen.size(), kPointsPerTask, options.threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t index = kept[chosen[i]];
      result[i] = samples[index];
      const auto hit = tree.find(surface.positions[index], reach);
      if (hit) result[i].cloud = hit->distance;
    }
  });
  return result;
}

CloudScore score(const std::vector<PointError>& errors, const std::vector<Coverage>& coverage, double threshold,
                 bool relative) {
  const auto bound = static_cast<float>(threshold);
  std::size_t accurate = 0;
  std::size_t accurate_point = 0;
  for (const PointError& error : errors) {
    const float limit = relative ? bound * error.camera : bound;
    if (error.plane <= limit) ++accurate;
    if (error.point <= limit) ++accurate_point;
  }
  std::size_t covered = 0;
  double covered_weight = 0.0;
  double weight = 0.0;
  for (const Coverage& sample : coverage) {
    weight += sample.weight;
    if (sample.cloud > (relative ? bound * sample.camera : bound)) continue;
    ++covered;
    covered_weight += sample.weight;
  }
  const auto points = static_cast<double>(errors.size());
  return {threshold, static_cast<double>(accurate) / points, static_cast<double>(accurate_point) / points,
          static_cast<double>(covered) / static_cast<double>(coverage.size()), covered_weight / weight};
}

template <class Value>
void median_and_p90(const std::vector<PointError>& errors, const Value& value, double& median, double& p90) {
  std::vector<float> values;
  values.reserve(errors.size());
  for (const PointError& error : errors) values.push_back(value(error));
  median = percentile(values, 50.0);
  p90 = percentile(values, 90.0);
}

}  // namespace

AlignedCloud align_cloud(const std::vector<Eigen::Vector3d>& points, const std::vector<TimedPose>& keyframes,
                         const Similarity& truth_from_map, const Eigen::Vector3d& origin) {
  AlignedCloud cloud;
  cloud.points.reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3f moved = (truth_from_map * point - origin).cast<float>();
    if (moved.allFinite()) {
      cloud.points.push_back(moved);
    } else {
      ++cloud.dropped;
    }
  }
  if (cloud.points.empty()) throw InvalidInput("the cloud contains no points");
  for (const TimedPose& keyframe : keyframes) {
    cloud.keyframes.push_back({keyframe.id, keyframe.timestamp, truth_from_map * keyframe.world_from_cam});
    cloud.keyframes.back().world_from_cam.translation -= origin;
  }
  return cloud;
}

CloudMeasures measure_cloud(const AlignedCloud& cloud, const Surface& surface, const CloudMeasureOptions& options) {
  const std::vector<Eigen::Vector3f> centers = centers_of(cloud.keyframes);
  const NearestPoint cameras(centers);
  const auto errors = measure_points(cloud, surface, cameras, options);
  CloudMeasures result;
  const auto coverage = measure_coverage(cloud, surface, cameras, options, result.surface_samples);
  result.points = cloud.points.size();
  median_and_p90(
      errors, [](const PointError& e) { return e.plane; }, result.error_median_m, result.error_p90_m);
  median_and_p90(
      errors, [](const PointError& e) { return e.point; }, result.error_median_point_m, result.error_p90_point_m);
  median_and_p90(
      errors, [](const PointError& e) { return e.plane / e.camera; }, result.error_median_relative,
      result.error_p90_relative);
  for (const double t : options.relative) result.relative.push_back(score(errors, coverage, t, true));
  for (const double t : options.absolute_m) result.absolute.push_back(score(errors, coverage, t, false));
  if (!surface.weights.empty()) return result;
  for (auto* scores : {&result.relative, &result.absolute}) {
    for (CloudScore& s : *scores) s.completeness_visible = std::numeric_limits<double>::quiet_NaN();
  }
  return result;
}

}  // namespace pmsp::eval
