// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
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

  void add(const LiveKeyframe& keyframe);

  /// Those that are not known are passed over. Returns the places that have changed, those included that have only got
  /// another scale.
  std::vector<LiveMove> move(const std::vector<const LiveKeyframe*>& keyframes);

  void erase(std::int64_t id) { tracks_.erase(id); }
  void reset() { tracks_.clear(); }

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
    /// As it was when the scales around were last agreed on: baselines between keyframes and ranges of landmarks then
    /// are what those of now are compared with.
    KeyframePose agreed;
    std::vector<Range> agreed_ranges;  ///< ascending ids
    std::vector<Range> ranges;         ///< the newest
  };
  using Tracks = std::map<std::int64_t, Track>;

  static std::vector<Range> ranges_of(const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world);
  static bool has_left(const Track& track);
  void recover(const std::vector<Tracks::iterator>& flight, const std::set<std::size_t>& moved,
               std::map<std::int64_t, LiveMove>& changed);

  Tracks tracks_;
  std::int64_t rescaled_ = 0;
};

}  // namespace pmsp
