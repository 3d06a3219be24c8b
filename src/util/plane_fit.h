// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace pmsp {

/// Plane v (v . X = 1, camera frame) through points on rays, by least squares of their inverse depths.
class PlaneFit {
 public:
  void add(const Eigen::Vector3d& bearing, double inverse_depth) {
    a_ += bearing * bearing.transpose();
    b_ += inverse_depth * bearing;
    ++count_;
  }

  int count() const { return count_; }

  /// `steadiness`: regularisation against tilt if the rays are collinear, relative to the squared spread of unit
  /// bearings. Returns false if there is no such plane.
  bool solve(double steadiness, Eigen::Vector3d& plane) const {
    plane = (a_ + steadiness * count_ * Eigen::Matrix3d::Identity()).ldlt().solve(b_);
    return plane.allFinite();
  }

 private:
  Eigen::Matrix3d a_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b_ = Eigen::Vector3d::Zero();
  int count_ = 0;
};

}  // namespace pmsp
