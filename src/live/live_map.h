// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/live.h"

namespace pmsp {

/// Pose of a keyframe and id of its SLAM map.
struct LivePose {
  std::int64_t keyframe_id = 0;
  KeyframePose pose;
  std::int64_t map_id = 0;
};

/// Points of a live map, by keyframe and version. Thread-safe; the lock is held for short work per keyframe, points are
/// freed outside it. Each call with an effect increments the version.
class PMSP_API LiveMap {
 public:
  /// Sets or replaces a keyframe's points.
  void publish(const LivePose& pose, std::shared_ptr<const KeyframeCloud> cloud, bool preliminary);

  /// Ignores keyframes without points.
  void move(const std::vector<LivePose>& poses);

  void remove(const std::vector<std::int64_t>& keyframe_ids);

  /// Removes keyframes whose points are preliminary. Returns whether there were any.
  bool remove_preliminary(const std::vector<std::int64_t>& keyframe_ids);

  /// Removes all keyframes; ids may restart.
  void reset();

  LiveVersion version() const;

  /// Returns the same object until the next change.
  std::shared_ptr<const LiveSnapshot> snapshot() const;

  /// `since`: version of a snapshot or of earlier changes; later than the current one counts as current.
  LiveChanges changes_since(LiveVersion since) const;

 private:
  struct Entry {
    LiveCloud cloud;
    LiveVersion added_version = 0;  ///< version that added the keyframe
  };

  /// Versions that added and removed a keyframe.
  struct VersionInterval {
    LiveVersion since, until;
  };
  bool had_points(std::int64_t id, LiveVersion at) const;

  mutable std::mutex mutex_;
  LiveVersion version_ = 0;
  LiveVersion reset_version_ = 0;                                 ///< version of the last reset
  std::map<std::int64_t, Entry> entries_;                         ///< by keyframe
  std::map<std::int64_t, std::vector<VersionInterval>> removed_;  ///< by keyframe, since the last reset
  mutable std::shared_ptr<const LiveSnapshot> snapshot_;          ///< cached, nullptr or possibly outdated
};

}  // namespace pmsp
