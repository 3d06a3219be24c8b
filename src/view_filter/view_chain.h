// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <deque>
#include <vector>

#include <Eigen/Core>

#include "plan/plan.h"
#include "pmsp/options.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// Newest used keyframes, for the decision on the next one. Thresholds are shifted in favour of a previous decision, so
/// that small moves do not change it.
class ViewChain {
 public:
  enum class Preference { kNone, kUse, kReject };

  /// Decision by parallax.
  struct Verdict {
    KeyframeUse use = KeyframeUse::kDepthMap;
    bool redundant = false;  ///< overlap suffices without it, if it is blurred
  };

  explicit ViewChain(const ViewFilterOptions& options) : options_(options) {}

  bool empty() const { return empty_; }
  void clear();

  /// An empty chain accepts any keyframe.
  Verdict compare(const std::vector<Landmark>& landmarks, const Eigen::Vector3d& center,
                  Preference preference = Preference::kNone) const;

  /// Whether its median sharpness relative to the last keyframes is too low; the median tolerates a blurred one among
  /// them.
  bool is_blurred(const std::vector<LandmarkSharpness>& sharpness, Preference preference = Preference::kNone) const;

  /// Makes the keyframe the newest one. Without `add_sharpness` it is ignored by tests for blur.
  void add(const std::vector<Landmark>& landmarks, const Eigen::Vector3d& center);
  void add_sharpness(std::vector<LandmarkSharpness> sharpness);

 private:
  ViewFilterOptions options_;
  bool empty_ = true;
  std::vector<Landmark> newest_landmarks_;
  Eigen::Vector3d newest_center_ = Eigen::Vector3d::Zero();
  std::deque<std::vector<LandmarkSharpness>> recent_;  ///< sharpness of the last keyframes
};

/// Returns a threshold shifted in favour of the previous decision. `lower`: a lower threshold favours use.
double biased_threshold(double threshold, ViewChain::Preference preference, bool lower);

}  // namespace pmsp
