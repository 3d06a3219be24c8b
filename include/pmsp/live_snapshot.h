// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "pmsp/point_cloud.h"
#include "pmsp/transform.h"

namespace pmsp {

/// Counts what happens to a live map. Of two versions the later one is the higher; 0 = the empty map at the start.
using LiveVersion = std::uint64_t;

/// A keyframe's points at one moment. A viewer draws `cloud->points` with `pose`: where only the pose has changed, what
/// it has on the GPU stays.
struct LiveCloud {
  std::int64_t keyframe_id = 0;
  std::int64_t map_id = 0;  ///< of the SLAM's map that the pose belongs to
  KeyframePose pose;        ///< the newest one; that of `cloud` is as it was when the points were made
  std::shared_ptr<const KeyframeCloud> cloud;  ///< never null; does not change
  bool preliminary = false;                    ///< final points will replace these
  LiveVersion cloud_since = 0;                 ///< version that brought these points
  LiveVersion pose_since = 0;                  ///< version that brought this pose
};

/// A live map at one moment. It never changes, and costs nothing to hold but the clouds that it names.
struct LiveSnapshot {
  LiveVersion version = 0;
  std::vector<LiveCloud> clouds;  ///< by ascending keyframe id
};

/// What makes one version of a live map of an earlier one. Each keyframe is in one list at most.
struct LiveChanges {
  LiveVersion from = 0;
  LiveVersion to = 0;
  bool reset = false;  ///< the map began anew in between: drop all that is there first; all clouds are in `added`
  std::vector<LiveCloud> added;
  std::vector<LiveCloud> replaced;  ///< other points, perhaps at another pose
  std::vector<LiveCloud> moved;     ///< the same points at another pose or in another map
  std::vector<std::int64_t> removed;
  bool empty() const { return !reset && added.empty() && replaced.empty() && moved.empty() && removed.empty(); }
};

}  // namespace pmsp
