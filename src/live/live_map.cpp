// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_map.h"

#include <algorithm>
#include <utility>

namespace pmsp {

void LiveMap::publish(const LivePose& pose, std::shared_ptr<const KeyframeCloud> cloud, bool preliminary) {
  std::shared_ptr<const KeyframeCloud> replaced;  // freed outside the lock
  const std::lock_guard<std::mutex> lock(mutex_);
  ++version_;
  Entry& entry = entries_[pose.keyframe_id];
  replaced = std::move(entry.cloud.cloud);
  if (!replaced) entry.added_version = version_;
  const bool moved = !replaced || entry.cloud.pose != pose.pose || entry.cloud.map_id != pose.map_id;
  const LiveVersion pose_since = moved ? version_ : entry.cloud.pose_since;
  entry.cloud = {pose.keyframe_id, pose.map_id, pose.pose, std::move(cloud), preliminary, version_, pose_since};
}

void LiveMap::move(const std::vector<LivePose>& poses) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const LiveVersion next = version_ + 1;
  for (const LivePose& pose : poses) {
    const auto found = entries_.find(pose.keyframe_id);
    if (found == entries_.end()) continue;
    LiveCloud& cloud = found->second.cloud;
    if (cloud.pose == pose.pose && cloud.map_id == pose.map_id) continue;
    cloud.pose = pose.pose;
    cloud.map_id = pose.map_id;
    cloud.pose_since = next;
    version_ = next;
  }
}

void LiveMap::remove(const std::vector<std::int64_t>& keyframe_ids) {
  std::vector<Entry> gone;  // freed outside the lock
  const std::lock_guard<std::mutex> lock(mutex_);
  const LiveVersion next = version_ + 1;
  for (const std::int64_t id : keyframe_ids) {
    const auto found = entries_.find(id);
    if (found == entries_.end()) continue;
    gone.push_back(std::move(found->second));
    entries_.erase(found);
    removed_[id].push_back({gone.back().added_version, next});
    version_ = next;
  }
}

bool LiveMap::remove_preliminary(const std::vector<std::int64_t>& keyframe_ids) {
  std::vector<std::int64_t> ids;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const std::int64_t id : keyframe_ids) {
      const auto found = entries_.find(id);
      if (found != entries_.end() && found->second.cloud.preliminary) ids.push_back(id);
    }
  }
  if (!ids.empty()) remove(ids);
  return !ids.empty();
}

void LiveMap::reset() {
  std::map<std::int64_t, Entry> gone;  // freed outside the lock
  const std::lock_guard<std::mutex> lock(mutex_);
  gone.swap(entries_);
  removed_.clear();
  reset_version_ = ++version_;
}

LiveVersion LiveMap::version() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return version_;
}

std::shared_ptr<const LiveSnapshot> LiveMap::snapshot() const {
  std::shared_ptr<const LiveSnapshot> outdated;  // freed outside the lock
  const std::lock_guard<std::mutex> lock(mutex_);
  if (snapshot_ && snapshot_->version == version_) return snapshot_;
  auto made = std::make_shared<LiveSnapshot>();
  made->version = version_;
  made->clouds.reserve(entries_.size());
  for (const auto& [id, entry] : entries_) made->clouds.push_back(entry.cloud);
  outdated = std::exchange(snapshot_, std::move(made));
  return snapshot_;
}

LiveChanges LiveMap::changes_since(LiveVersion since) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  LiveChanges changes;
  changes.from = std::min(since, version_);
  changes.to = version_;
  changes.reset = changes.from < reset_version_;
  for (const auto& [id, entry] : entries_) {
    const LiveCloud& cloud = entry.cloud;
    if (changes.reset || entry.added_version > changes.from) {
      const bool replaced = !changes.reset && had_points(id, changes.from);  // removed and added again
      (replaced ? changes.replaced : changes.added).push_back(cloud);
    } else if (cloud.cloud_since > changes.from) {
      changes.replaced.push_back(cloud);
    } else if (cloud.pose_since > changes.from) {
      changes.moved.push_back(cloud);
    }
  }
  if (changes.reset) return changes;
  for (const auto& [id, intervals] : removed_) {
    if (entries_.count(id) == 0 && had_points(id, changes.from)) changes.removed.push_back(id);
  }
  return changes;
}

/// Whether a keyframe that was removed later had points at a version.
bool LiveMap::had_points(std::int64_t id, LiveVersion at) const {
  const auto gone = removed_.find(id);
  if (gone == removed_.end()) return false;
  return std::any_of(gone->second.begin(), gone->second.end(),
                     [&](const VersionInterval& interval) { return interval.since <= at && at < interval.until; });
}

}  // namespace pmsp
