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

/// Where a SLAM's keyframes are, and how long their units are. Scales, which nobody tells, are found from what moves
/// (scale_recovery.h).
class LiveTracker {
 public:
  bool knows(std::int64_t id) const { return tracks_.count(id) != 0; }
  /// Of one that is known.
  LiveMove place_of(std::int64_t id) const;
  /// Of all, ascending.
  std::vector<std::int64_t> ids() const;

  /// `serial`: another one for each keyframe, whatever its id; not 0.
  void add(const LiveKeyframe& keyframe, std::uint64_t serial);

  /// 0 = it is not known.
  std::uint64_t serial_of(std::int64_t id) const;

  /// Whether the keyframe is one of the last `count` of its map.
  bool is_recent(std::int64_t id, std::size_t count) const;

  /// Nothing hangs on the keyframe: its landmarks need not be remembered.
  void forget_landmarks(std::int64_t id);

  /// Those that are not known are passed over. Returns the places that have changed, those included that have only got
  /// another scale.
  std::vector<LiveMove> move(const std::vector<const LiveKeyframe*>& keyframes);

  void erase(std::int64_t id);
  void reset();

  std::int64_t rescaled() const { return rescaled_; }

 private:
  /// How far a landmark was from the camera, in the world's unit.
  struct Range {
    std::int64_t landmark;
    double range;
  };

  struct Track {
    KeyframePose now;
    std::int64_t map_id = 0;
    std::uint64_t serial = 0;
    /// As it was when the scales around were last agreed on: baselines between keyframes and ranges of landmarks then
    /// are what those of now are compared with.
    KeyframePose agreed;
    std::int64_t agreed_map_id = 0;
    std::vector<Range> agreed_ranges;  ///< ascending ids
    std::vector<Range> ranges;         ///< the newest of these; none where they are not known since the last move
    bool remembers = true;             ///< landmarks
  };
  using Sequence = std::vector<std::pair<std::int64_t, Track*>>;  ///< ascending ids

  static std::vector<Range> ranges_of(const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world);
  static void measure_ranges(Track& track, const LiveKeyframe& keyframe);
  static bool has_moved_away(const Track& track);
  static Sequence::iterator place(Sequence& sequence, std::int64_t id);
  void recover(Sequence& sequence, const std::set<std::size_t>& moved, std::map<std::int64_t, LiveMove>& changed);

  std::map<std::int64_t, Track> tracks_;
  std::map<std::int64_t, Sequence> sequences_;  ///< by map
  std::int64_t rescaled_ = 0;
};

}  // namespace pmsp
