// SPDX-License-Identifier: BSD-2-Clause
#include "export/fit_similarity.h"

#include <cmath>
#include <cstddef>
#include <string>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "pmsp/error.h"

namespace pmsp {
namespace {

constexpr double kLineRatio = 0.02;

using Points = std::vector<Eigen::Vector3d>;

Eigen::Vector3d mean_of(const Points& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

Eigen::Matrix3d cross_covariance(const Points& target, const Eigen::Vector3d& target_mean, const Points& source,
                                 const Eigen::Vector3d& source_mean) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < source.size(); ++i) {
    sum += (target[i] - target_mean) * (source[i] - source_mean).transpose();
  }
  return sum / static_cast<double>(source.size());
}

}  // namespace

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
}

bool is_a_line(const Points& points) {
  const Eigen::Vector3d mean = mean_of(points);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross_covariance(points, mean, points, mean));
  // Singular values of the covariance are the squares of those of the points.
  return svd.singularValues()[1] <= kLineRatio * kLineRatio * svd.singularValues()[0];
}

Similarity with_rotation(const Eigen::Matrix3d& rotation, const Points& source, const Points& target) {
  const Eigen::Vector3d source_mean = mean_of(source);
  const Eigen::Vector3d target_mean = mean_of(target);
  double product = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    product += (rotation * (source[i] - source_mean)).dot(target[i] - target_mean);
    square += (source[i] - source_mean).squaredNorm();
  }
  const double scale = product / square;
  if (!(scale > 0.0) || !std::isfinite(scale)) {
    throw InvalidInput(
        "the two cannot be aligned: the matched positions coincide or move in opposite directions; check that both "
        "belong to the same mission");
  }
  return {scale, rotation, target_mean - scale * (rotation * source_mean)};
}

Similarity umeyama(const Points& source, const Points& target) {
  if (source.size() != target.size() || source.size() < 3) {
    throw InvalidInput("an alignment needs at least three pairs of points, got " + std::to_string(source.size()) +
                       " and " + std::to_string(target.size()) + " points");
  }
  // For the optimal rotation, trace(D S) / variance is the same scale as the projection onto the rotated source.
  return with_rotation(nearest_rotation(cross_covariance(target, mean_of(target), source, mean_of(source))), source,
                       target);
}

}  // namespace pmsp
