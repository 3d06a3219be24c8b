// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp/keyframe.h"
#include "pmsp/options.h"

namespace pmsp {

/// Parallax of the landmarks that two camera centres have in common.
struct CommonParallax {
  int landmarks = 0;        ///< observed from both
  int in_range = 0;         ///< with a parallax between the two angles
  double median_deg = 0.0;  ///< 0 without common landmarks
};

/// Parallax of a landmark = angle between the rays to it from the two centres. `a` and `b` need not be sorted.
CommonParallax common_parallax(const std::vector<Landmark>& a, const Eigen::Vector3d& center_a,
                               const std::vector<Landmark>& b, const Eigen::Vector3d& center_b, double min_deg,
                               double max_deg);

/// Accepts keyframes that see enough of what the newest accepted one saw from a usefully different place. The first one
/// is always accepted; one without common landmarks never (Surmann et al. 2022, section III-A).
class ViewFilter {
 public:
  /// Throws InvalidOption.
  explicit ViewFilter(const ViewFilterOptions& options);

  /// Decides on the next keyframe; if accepted, it becomes the newest one. Only pose and landmarks are read.
  bool accept(const Keyframe& keyframe);

  /// The next keyframe is accepted whatever it is.
  void reset();

 private:
  ViewFilterOptions options_;
  bool has_newest_ = false;
  std::vector<Landmark> newest_landmarks_;
  Eigen::Vector3d newest_center_ = Eigen::Vector3d::Zero();
};

}  // namespace pmsp
