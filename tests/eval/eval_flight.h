// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/alignment.h"
#include "pmsp-eval/trajectory.h"
#include "pmsp/types.h"

namespace pmsp_test {

/// Distance from a point along a unit direction to the surface around it; both in the truth's frame [m].
using Shape = std::function<double(const Eigen::Vector3d& from, const Eigen::Vector3d& direction)>;

/// The inside of an axis-aligned box about the origin.
Shape box(const Eigen::Vector3d& half_size);

/// The inside of a sphere about the origin.
Shape sphere(double radius);

/// A short flight inside a shape, with truth and a "map" that differs from it by a similarity.
class Flight {
 public:
  /// `keyframes` poses within about `reach` metres of the origin, ten a second, turning as they go.
  Flight(Shape shape, int keyframes, double reach);

  const Shape& shape() const { return shape_; }
  const std::vector<pmsp::eval::TimedPose>& truth() const { return truth_; }
  const pmsp::Similarity& truth_from_map() const { return truth_from_map_; }

  /// The keyframes in the frame of the map.
  std::vector<pmsp::eval::TimedPose> keyframes() const;

  Eigen::Vector3d to_map(const Eigen::Vector3d& point) const;

  /// Range image of one keyframe [m].
  pmsp::Image<float> range(std::size_t keyframe, int height) const;

  /// Points at all pixel centres of all keyframes, at `factor` times the true distance, in the frame of the map.
  std::vector<Eigen::Vector3d> points(int height, double factor = 1.0) const;

  /// Writes traj_tum.txt and range_mm/, with range maps of this height.
  void write_truth(const std::filesystem::path& folder, int height) const;

 private:
  Shape shape_;
  std::vector<pmsp::eval::TimedPose> truth_;
  pmsp::Similarity truth_from_map_;
};

/// Points on a sphere, about `spacing` apart, in the frame of the truth.
std::vector<Eigen::Vector3d> sphere_points(double radius, double spacing);

}  // namespace pmsp_test
