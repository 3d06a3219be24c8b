// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/helpers.h"
#include "pmsp/live.h"
#include "synth/mission.h"

namespace pmsp::test {

/// A mission's keyframe as passed by a SLAM; its pixels live as long as the mission.
LiveKeyframe live_keyframe(const synth::Mission& mission, std::size_t index);
std::vector<LiveKeyframe> live_keyframes(const synth::Mission& mission);

/// A flight through a room. Tests that need its depths to be good have the tag PMSP_ACCURACY.
constexpr int kRoomWidth = kSanitized ? 32 : 128;
constexpr int kRoomKeyframes = kSanitized ? 8 : 13;
const synth::Mission& room();

/// The online preset on small images, without previews, so that results do not depend on time.
LiveOptions small_live(int width);

/// Timeout longer than any work.
constexpr std::chrono::minutes kLong{30};

/// Results of keyframes that are all passed before any is densified. Throws if that fails.
std::shared_ptr<const LiveSnapshot> at_once(const std::vector<LiveKeyframe>& keyframes, const LiveOptions& options);

std::vector<std::int64_t> ids_of(const LiveSnapshot& snapshot);

/// Accuracy and completeness of the final points of a snapshot.
struct LiveFigures {
  std::size_t clouds = 0;
  std::size_t points = 0;
  double covered = 0.0;    ///< points for each pixel of the keyframes that have some
  double right = 0.0;      ///< share within 2 % of the true range, poses and scales included
  double misplaced = 0.0;  ///< median distance of points from the true surface, relative to the range
};

/// Depth maps and images of `mission` have one size.
LiveFigures figures(const LiveSnapshot& snapshot, const synth::Mission& mission);

/// Whether the final points are the same, byte for byte.
bool same_points(const LiveSnapshot& a, const LiveSnapshot& b);

}  // namespace pmsp::test
