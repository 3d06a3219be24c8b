// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "plan/plan.h"
#include "view_filter/view_chain.h"

namespace pmsp {

/// A used keyframe while the entries that look at it are decided.
struct PlanNode {
  PlanNode(PlanKeyframe&& given, std::size_t index);

  Keyframe keyframe;
  Eigen::Vector3d center;
  double reach;       ///< keyframes farther away than this are not asked about its points [scene units]
  std::size_t entry;  ///< index of its entry
  bool has_depth_map = false;
};

/// The previous plan, by id.
class PreviousPlan {
 public:
  explicit PreviousPlan(const Plan* plan);

  /// nullptr when there is none.
  const PlanEntry* find(std::int64_t id) const;
  ViewChain::Lean lean(std::int64_t id) const;

 private:
  std::unordered_map<std::int64_t, PlanEntry> entries_;
};

/// By how much farther away than within reach a keyframe may lie that was asked before.
constexpr double kReachMargin = 1.1;

/// One of the keyframes that may be asked about a keyframe's points.
struct ViewerCandidate {
  std::int64_t id;
  double distance;  ///< of the two cameras [scene units]
};

/// The fusion window, and up to `count` besides of the others within reach, spread evenly over the list. `before`: the
/// choice of the previous plan.
std::vector<std::int64_t> choose_viewers(const PlanNode& node, const std::vector<std::int64_t>& window,
                                         const std::vector<ViewerCandidate>& candidates, int count,
                                         const std::vector<std::int64_t>* before);

/// The range of the landmarks, or the one before where it hardly differs.
DepthRange choose_range(const Keyframe& keyframe, const InitOptions& options, const PlanEntry* previous);

/// The places of keyframes in a list of candidates, by id.
using Places = std::unordered_map<std::int64_t, std::size_t>;

/// Of `ids`; empty unless all are there.
std::vector<std::size_t> places_of(const std::vector<std::int64_t>& ids, const Places& candidates);

/// What stays for what was decided before is worth this share of the new choice at least.
constexpr double kNearlyAsGood = 0.9;

/// Near neighbours in a flight: places in `sequence`, the keyframes around and the reference itself, in order.
std::vector<std::size_t> choose_near(const std::vector<const Keyframe*>& sequence, std::size_t reference, int count,
                                     const PlanEntry* previous);

/// `use` and `range` of an entry whose `near` is decided.
void settle(PlanEntry& entry, const DepthRange& range);

}  // namespace pmsp
