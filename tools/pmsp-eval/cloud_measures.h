// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pmsp-eval/alignment.h"
#include "pmsp-eval/surface.h"

namespace pmsp::eval {

/// Cloud and keyframes in the frame of the truth: metres, minus GroundTruth::origin.
struct AlignedCloud {
  std::vector<Eigen::Vector3f> points;
  std::vector<TimedPose> keyframes;
  std::size_t dropped = 0;  ///< points with non-finite coordinates
};

/// Throws InvalidInput if no point remains.
AlignedCloud align_cloud(const std::vector<Eigen::Vector3d>& points, const std::vector<TimedPose>& keyframes,
                         const Similarity& truth_from_map, const Eigen::Vector3d& origin);

struct CloudMeasureOptions {
  std::vector<double> relative = {0.01, 0.02, 0.05};         ///< shares of the distance to the nearest keyframe, > 0
  std::vector<double> absolute_m = {0.01, 0.02, 0.05, 0.1};  ///< [m], > 0
  double max_range_m = 15.0;                                 ///< true surface farther from all keyframes is ignored [m]
  double voxel_m = 0.01;                                     ///< of the surface [m]
  std::size_t max_points = 1000000;                          ///< random sample of cloud points for accuracy; 0 = all
  std::size_t max_truth = 1000000;                           ///< random sample of the surface for completeness; 0 = all
  std::uint64_t seed = 1;                                    ///< of the samples
  int threads = 0;                                           ///< 0 = one per CPU
};

/// Shares, 0 to 1, at one threshold.
struct CloudScore {
  double threshold = 0.0;
  double accuracy = 0.0;        ///< of cloud points within the threshold of the surface
  double accuracy_point = 0.0;  ///< as `accuracy`, by distance to the nearest sample instead of its plane
  double completeness = 0.0;    ///< of surface samples within the threshold of a cloud point
  /// As `completeness`, samples weighted by their solid angle in all views; NaN for scans.
  double completeness_visible = 0.0;

  double f() const { return harmonic(accuracy, completeness); }
  double f_visible() const { return harmonic(accuracy, completeness_visible); }

 private:
  static double harmonic(double a, double b) { return a + b == 0.0 ? 0.0 : 2.0 * a * b / (a + b); }
};

struct CloudMeasures {
  std::size_t points = 0;           ///< of the cloud
  std::size_t surface_samples = 0;  ///< within max_range_m
  double error_median_m = 0.0;      ///< distance to the surface
  double error_p90_m = 0.0;
  double error_median_point_m = 0.0;  ///< distance to the nearest sample
  double error_p90_point_m = 0.0;
  double error_median_relative = 0.0;  ///< ratio of the distances to the surface and to the nearest keyframe
  double error_p90_relative = 0.0;
  std::vector<CloudScore> relative;
  std::vector<CloudScore> absolute;
};

/// Measures distances between cloud and surface. The error of a point is its distance to the plane of the nearest
/// surface sample if its tangential offset is at most 1.5 sample spacings (or two voxels), else its distance to the
/// sample. Throws InvalidInput without surface within max_range_m.
CloudMeasures measure_cloud(const AlignedCloud& cloud, const Surface& surface, const CloudMeasureOptions& options = {});

}  // namespace pmsp::eval
