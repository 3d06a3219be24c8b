// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "live/live_map.h"
#include "pmsp/live.h"

namespace pmsp {

/// Poses and scales of a SLAM's keyframes. Scales, which SLAMs do not report, are estimated from moves
/// (plan/scale_recovery.h).
class LiveTracker {
 public:
  /// `id` must be known.
  LivePose pose_of(std::int64_t id) const;
  /// Ascending.
  std::vector<std::int64_t> ids() const;

  /// `serial`: unique among all added keyframes, even if an id is reused; not 0.
  void add(const LiveKeyframe& keyframe, std::uint64_t serial);

  /// Returns 0 if the id is unknown.
  std::uint64_t serial_of(std::int64_t id) const;

  /// Whether the keyframe is one of the last `count` of its map.
  bool is_recent(std::int64_t id, std::size_t count) const;

  /// Releases the landmark ranges of a keyframe that is not used.
  void forget_landmarks(std::int64_t id);

  /// Ignores unknown ids. Returns all keyframes with a new pose, map or scale.
  std::vector<LivePose> move(const std::vector<LiveKeyframe>& keyframes);

  void erase(std::int64_t id);
  void reset();

  std::int64_t rescaled() const { return rescaled_; }

 private:
  /// Distance of a landmark from the camera [map units].
  struct Range {
    std::int64_t landmark;
    double range;
  };

  struct KeyframeState {
    KeyframePose now;
    std::int64_t map_id = 0;
    std::uint64_t serial = 0;
    /// Reference state for new scales, with known scales around: its baselines and landmark ranges are compared with
    /// the current ones.
    KeyframePose reference;
    std::int64_t reference_map_id = 0;
    std::vector<Range> reference_ranges;  ///< by ascending landmark id
    std::vector<Range> ranges;            ///< current ranges; empty if unknown since the last move
    bool stores_ranges = true;            ///< false after forget_landmarks
  };
  using Sequence = std::vector<std::pair<std::int64_t, KeyframeState*>>;  ///< keyframes of a map by ascending id

  static std::vector<Range> ranges_of(const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world);
  static void measure_ranges(KeyframeState& state, const LiveKeyframe& keyframe);
  static bool has_moved_away(const KeyframeState& state);
  static Sequence::iterator position_of(Sequence& sequence, std::int64_t id);
  void recover(Sequence& sequence, const std::set<std::size_t>& moved, std::map<std::int64_t, LivePose>& changed);

  std::map<std::int64_t, KeyframeState> keyframes_;
  std::map<std::int64_t, Sequence> sequences_;  ///< by map
  std::int64_t rescaled_ = 0;
};

}  // namespace pmsp
