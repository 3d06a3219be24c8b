// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "plan/plan.h"

namespace pmsp {

inline bool operator==(const PlanEntry& a, const PlanEntry& b) {
  return a.id == b.id && a.use == b.use && a.near == b.near && a.first_planes == b.first_planes &&
         a.range.min == b.range.min && a.range.max == b.range.max && a.consistency == b.consistency &&
         a.fusion == b.fusion && a.viewers == b.viewers && a.duplicate_views == b.duplicate_views;
}

inline bool operator==(const Plan& a, const Plan& b) { return a.entries == b.entries; }

}  // namespace pmsp

namespace pmsp::test {

/// A hall or corridor of which keyframes see landmarks on all sides, by poses alone.
struct MissionRecipe {
  std::uint32_t seed = 1;
  int keyframes = 200;
  int landmarks_seen = 60;   ///< by a keyframe, at most
  double step = 0.35;        ///< from keyframe to keyframe [map units]
  double density = 12.0;     ///< landmarks for each unit of length of a corridor
  double sight = 8.0;        ///< maximum range of landmarks [map units]
  double skipped_ids = 0.1;  ///< share of ids that are missing, as after culling
  std::int64_t first_id = 0;
};

/// Along x through a corridor 3 wide and 2.5 high; `passes` times out and back, on lines beside each other.
std::vector<PlanKeyframe> corridor(const MissionRecipe& recipe, int passes = 1);
/// Around a block, back to where it began.
std::vector<PlanKeyframe> loop(const MissionRecipe& recipe);
/// A walk that turns, waits and hurries at random in a hall.
std::vector<PlanKeyframe> walk(const MissionRecipe& recipe);
/// Captures at random places of a wide floor, in random order.
std::vector<PlanKeyframe> photos(const MissionRecipe& recipe);

/// A sharpness record of all landmarks with the blur `factor` of the image (1 = sharp).
SharpnessRecord sharpness(const PlanKeyframe& keyframe, float factor);

/// Every pose moved and rotated by up to these amounts.
std::vector<PlanKeyframe> jittered(std::vector<PlanKeyframe> keyframes, double by, std::uint32_t seed);

/// Names the difference, for a failing test.
std::string difference(const Plan& a, const Plan& b);

}  // namespace pmsp::test
