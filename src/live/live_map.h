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

/// A keyframe's new place.
struct LiveMove {
  std::int64_t keyframe_id = 0;
  KeyframePose pose;
  std::int64_t map_id = 0;
};

/// The points of a live map, by keyframe and version. All members may be called from any thread at any time; what takes
/// longer than a look at each keyframe happens outside the lock. Each call that changes something makes one version.
class PMSP_API LiveMap {
 public:
  /// Puts a keyframe's points in place of those that it has.
  void publish(const LiveMove& place, std::shared_ptr<const KeyframeCloud> cloud, bool preliminary);

  /// Those that have no points, or are there already, change nothing.
  void move(const std::vector<LiveMove>& places);

  void remove(const std::vector<std::int64_t>& keyframe_ids);

  /// Those of them whose points are preliminary. Returns whether there were any.
  bool remove_preliminary(const std::vector<std::int64_t>& keyframe_ids);

  /// Ids may begin again.
  void reset();

  LiveVersion version() const;  ///< of the last change

  /// The same object as long as nothing changes.
  std::shared_ptr<const LiveSnapshot> snapshot() const;

  /// `since`: a version that a snapshot or a change has told. One that is yet to come is taken for the present one.
  LiveChanges changes_since(LiveVersion since) const;

 private:
  struct Entry {
    LiveCloud cloud;
    LiveVersion there_since = 0;  ///< version in which the keyframe got its first points
  };

  /// From the version in which a keyframe got points to the one in which it was removed.
  struct Stay {
    LiveVersion since, until;
  };
  bool was_there(std::int64_t id, LiveVersion at) const;

  mutable std::mutex mutex_;
  LiveVersion version_ = 0;
  LiveVersion began_ = 0;                                 ///< version of the last reset
  std::map<std::int64_t, Entry> entries_;                 ///< by keyframe
  std::map<std::int64_t, std::vector<Stay>> gone_;        ///< of keyframes that were removed since the last reset
  mutable std::shared_ptr<const LiveSnapshot> snapshot_;  ///< of `version_`, once somebody has asked
};

}  // namespace pmsp
