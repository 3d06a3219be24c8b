// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "pmsp/live.h"

/// Plays a recorded mission like a monocular SLAM: each keyframe moves about thirty times while newer ones are added;
/// with `drift`, scale and heading drift until a loop closure corrects all poses without reporting scales.
class FakeSlam {
 public:
  /// `truth`: keyframes in temporal order with the final poses of the SLAM; images may be missing.
  /// `drift`: relative error of the last keyframe's scale before the loop closure; 0 = no drift, no loop closure.
  /// `unrest`: factor on the moves of keyframes; 1 = as with stella_vslam.
  FakeSlam(std::vector<pmsp::LiveKeyframe> truth, double drift, double unrest = 1.0)
      : truth_(std::move(truth)), drift_(drift), unrest_(unrest) {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < truth_.size(); ++k) {
      const Eigen::Vector3d true_center = truth_[k].cam_from_world.center();
      if (k == 0) center = true_center;
      if (k > 0) center += scale(k) * (turn(k) * (true_center - truth_[k - 1].cam_from_world.center()));
      centers_.push_back(center);
      std::vector<double> ranges{0.0};
      for (const pmsp::Landmark& landmark : truth_[k].landmarks) {
        ranges.push_back((landmark.position_world - true_center).norm());
      }
      std::sort(ranges.begin(), ranges.end());
      ranges_.push_back(ranges[ranges.size() / 2]);
    }
  }

  std::size_t size() const { return truth_.size(); }

  /// Returns the next keyframe, just finished by the mapper.
  pmsp::LiveKeyframe next() {
    ++come_;
    return at_present(come_ - 1);
  }

  /// Returns the keyframes moved by the local bundle adjustment after it, without images.
  std::vector<pmsp::LiveKeyframe> moved() const {
    std::vector<pmsp::LiveKeyframe> result;
    for (std::size_t k = come_ > kWindow ? come_ - kWindow : 0; k + 1 < come_; ++k) {
      result.push_back(at_present(k));
      result.back().image = {};
    }
    return result;
  }

  /// Returns all keyframes after the loop closure and the last bundle adjustment.
  std::vector<pmsp::LiveKeyframe> closed() const {
    std::vector<pmsp::LiveKeyframe> result(truth_.begin(), truth_.begin() + static_cast<std::ptrdiff_t>(come_));
    for (pmsp::LiveKeyframe& keyframe : result) keyframe.image = {};
    return result;
  }

 private:
  static constexpr std::size_t kWindow = 30;

  double share(std::size_t k) const {
    return truth_.size() < 2 ? 0.0 : static_cast<double>(k) / static_cast<double>(truth_.size() - 1);
  }
  double scale(std::size_t k) const { return std::exp(std::log1p(drift_) * share(k)); }
  Eigen::Matrix3d turn(std::size_t k) const {
    return Eigen::AngleAxisd(0.5 * drift_ * share(k), Eigen::Vector3d::UnitY()).toRotationMatrix();
  }

  /// Returns the distance to the final position: about 0.2 % of the depth, decaying with newer keyframes as with
  /// stella_vslam.
  Eigen::Vector3d error(std::size_t k) const {
    const double newer = static_cast<double>(come_ - 1 - k);
    const double angle = 2.4 * static_cast<double>(k) + 0.3 * newer;
    const double size = unrest_ * 0.0022 * std::exp(-newer / 10.0) * ranges_[k] * scale(k);
    return size * Eigen::Vector3d(std::cos(angle), 0.5 * std::sin(1.7 * angle), std::sin(angle));
  }

  pmsp::LiveKeyframe at_present(std::size_t k) const {
    pmsp::LiveKeyframe keyframe = truth_[k];
    const Eigen::Vector3d true_center = keyframe.cam_from_world.center();
    const Eigen::Vector3d center = centers_[k] + error(k);
    keyframe.cam_from_world.rotation = keyframe.cam_from_world.rotation * turn(k).transpose();
    keyframe.cam_from_world.translation = -(keyframe.cam_from_world.rotation * center);
    for (pmsp::Landmark& landmark : keyframe.landmarks) {
      landmark.position_world = centers_[k] + scale(k) * (turn(k) * (landmark.position_world - true_center));
    }
    return keyframe;
  }

  std::vector<pmsp::LiveKeyframe> truth_;
  double drift_;
  double unrest_;
  std::vector<Eigen::Vector3d> centers_;  ///< with drift
  std::vector<double> ranges_;            ///< median distance of landmarks
  std::size_t come_ = 0;
};
