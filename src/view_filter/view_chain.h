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

/// The newest used keyframes, and whether the next one adds enough to them. What was decided before poses moved a
/// little leans the decision towards the same again.
class ViewChain {
 public:
  enum class Lean { kNone, kUse, kLeave };

  /// What parallax says.
  struct Verdict {
    KeyframeUse use = KeyframeUse::kDepthMap;
    bool dispensable = false;  ///< the chain does without it, should it be blurred
  };

  explicit ViewChain(const ViewFilterOptions& options) : options_(options) {}

  bool empty() const { return empty_; }
  void clear();

  /// Anything may follow an empty chain.
  Verdict compare(const std::vector<Landmark>& landmarks, const Eigen::Vector3d& center, Lean lean = Lean::kNone) const;

  /// Less sharp than the last keyframes have it in the median: one that is blurred itself does not hide the next.
  bool is_blurred(const std::vector<LandmarkSharpness>& sharpness, Lean lean = Lean::kNone) const;

  /// The keyframe becomes the newest one; without `sharpness` it is not compared with for blur.
  void add(const std::vector<Landmark>& landmarks, const Eigen::Vector3d& center);
  void add_sharpness(std::vector<LandmarkSharpness> sharpness);

 private:
  ViewFilterOptions options_;
  bool empty_ = true;
  std::vector<Landmark> newest_landmarks_;
  Eigen::Vector3d newest_center_ = Eigen::Vector3d::Zero();
  std::deque<std::vector<LandmarkSharpness>> recent_;  ///< of the last keyframes
};

/// How far a threshold moves towards what was decided before: `lower` says whether little leads to using.
double leaning(double threshold, ViewChain::Lean lean, bool lower);

}  // namespace pmsp
