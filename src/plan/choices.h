// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "plan/plan.h"
#include "view_filter/view_chain.h"

namespace pmsp {

/// Used keyframe while entries that may refer to it are undecided.
struct PlanNode {
  PlanNode(PlanKeyframe&& given, std::size_t index);

  Keyframe keyframe;
  Eigen::Vector3d center;
  double reach;       ///< maximum distance of viewers [map units]
  std::size_t entry;  ///< index of its entry
  bool has_depth_map = false;
};

/// Previous plan, by id.
class PreviousPlan {
 public:
  explicit PreviousPlan(const Plan* plan);

  /// Returns nullptr if there is none.
  const PlanEntry* find(std::int64_t id) const;
  ViewChain::Preference preference(std::int64_t id) const;

 private:
  std::unordered_map<std::int64_t, PlanEntry> entries_;
};

/// Factor on the reach within which previous viewers are kept.
constexpr double kReachMargin = 1.1;

/// Candidate for the viewers of a keyframe.
struct ViewerCandidate {
  std::int64_t id;
  double distance;  ///< between the two cameras [map units]
};

/// Returns the fusion window and up to `count` other candidates within reach, evenly spread over the list. `before`:
/// choice of the previous plan, kept if nearly as good.
std::vector<std::int64_t> choose_viewers(const PlanNode& node, const std::vector<std::int64_t>& window,
                                         const std::vector<ViewerCandidate>& candidates, int count,
                                         const std::vector<std::int64_t>* before);

/// Returns the depth range of the landmarks, or the previous one if nearly equal.
DepthRange choose_range(const Keyframe& keyframe, const InitOptions& options, const PlanEntry* previous);

/// Indices of keyframes in a list of candidates, by id.
using IndexById = std::unordered_map<std::int64_t, std::size_t>;

/// Returns the indices of `ids`; empty unless all are candidates.
std::vector<std::size_t> indices_of(const std::vector<std::int64_t>& ids, const IndexById& candidates);

/// Minimum value of a previous choice, relative to the new one, for being kept.
constexpr double kNearlyAsGood = 0.9;

/// Returns the source views of a keyframe, as indices into `sequence`, which has the surrounding keyframes and
/// `reference`, in order.
std::vector<std::size_t> choose_near(const std::vector<const Keyframe*>& sequence, std::size_t reference, int count,
                                     const PlanEntry* previous);

/// Sets `use` and `range` of an entry with known `near`.
void set_use_and_range(PlanEntry& entry, const DepthRange& range);

}  // namespace pmsp
