// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_tracker.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <iterator>
#include <utility>

#include "plan/scale_recovery.h"

namespace pmsp {
namespace {

/// Minimum number of landmark ranges stored per keyframe, if available (less than twice as many): enough for a median.
constexpr std::size_t kLandmarks = 48;

/// Displacement, relative to the mean landmark range, above which the reference states around are renewed.
constexpr double kFar = 0.02;

}  // namespace

LiveMove LiveTracker::pose_of(std::int64_t id) const {
  const Track& track = tracks_.at(id);
  return {id, track.now, track.map_id};
}

std::vector<std::int64_t> LiveTracker::ids() const {
  std::vector<std::int64_t> ids;
  ids.reserve(tracks_.size());
  for (const auto& [id, track] : tracks_) ids.push_back(id);
  return ids;
}

/// Returns ranges of landmarks spread evenly over the list.
std::vector<LiveTracker::Range> LiveTracker::ranges_of(const std::vector<Landmark>& landmarks,
                                                       const RigidTransform& cam_from_world) {
  std::vector<Range> ranges;
  const Eigen::Vector3d center = cam_from_world.center();
  const std::size_t step = std::max<std::size_t>(1, landmarks.size() / kLandmarks);
  for (std::size_t i = 0; i < landmarks.size(); i += step) {
    ranges.push_back({landmarks[i].id, (landmarks[i].position_world - center).norm()});
  }
  std::sort(ranges.begin(), ranges.end(), [](const Range& a, const Range& b) { return a.landmark < b.landmark; });
  return ranges;
}

LiveTracker::Sequence::iterator LiveTracker::place(Sequence& sequence, std::int64_t id) {
  return std::lower_bound(sequence.begin(), sequence.end(), id,
                          [](const auto& one, std::int64_t of) { return one.first < of; });
}

std::uint64_t LiveTracker::serial_of(std::int64_t id) const {
  const auto found = tracks_.find(id);
  return found == tracks_.end() ? 0 : found->second.serial;
}

void LiveTracker::add(const LiveKeyframe& keyframe, std::uint64_t serial) {
  Track& track = tracks_[keyframe.id];
  track.serial = serial;
  Sequence& sequence = sequences_[keyframe.map_id];
  sequence.insert(place(sequence, keyframe.id), {keyframe.id, &track});
  track.now = track.reference = {keyframe.cam_from_world, 1.0};
  track.map_id = track.reference_map_id = keyframe.map_id;
  track.ranges = track.reference_ranges = ranges_of(keyframe.landmarks, keyframe.cam_from_world);
}

void LiveTracker::erase(std::int64_t id) {
  const auto found = tracks_.find(id);
  if (found == tracks_.end()) return;
  Sequence& sequence = sequences_[found->second.map_id];
  sequence.erase(place(sequence, id));
  tracks_.erase(found);
}

void LiveTracker::reset() {
  tracks_.clear();
  sequences_.clear();
}

bool LiveTracker::is_recent(std::int64_t id, std::size_t count) const {
  const auto found = tracks_.find(id);
  if (found == tracks_.end()) return false;
  const Sequence& sequence = sequences_.at(found->second.map_id);
  return sequence.size() <= count || sequence[sequence.size() - count].first <= id;
}

void LiveTracker::forget_landmarks(std::int64_t id) {
  const auto found = tracks_.find(id);
  if (found == tracks_.end()) return;
  found->second.stores_ranges = false;
  std::vector<Range>().swap(found->second.ranges);
  std::vector<Range>().swap(found->second.reference_ranges);
}

/// Stores the current ranges, of the landmarks of the reference state if half of them are still observed.
void LiveTracker::measure_ranges(Track& track, const LiveKeyframe& keyframe) {
  track.ranges.clear();
  if (keyframe.landmarks.empty() || !track.stores_ranges) return;
  std::vector<Range> seen;
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  std::bitset<1024> known;  // rejects most other landmarks quickly
  const auto bit = [&](std::int64_t id) { return static_cast<std::size_t>(id) % known.size(); };
  for (const Range& range : track.reference_ranges) known.set(bit(range.landmark));
  for (const Landmark& landmark : keyframe.landmarks) {
    if (!known.test(bit(landmark.id))) continue;
    const auto at = std::lower_bound(track.reference_ranges.begin(), track.reference_ranges.end(), landmark.id,
                                     [](const Range& range, std::int64_t id) { return range.landmark < id; });
    if (at == track.reference_ranges.end() || at->landmark != landmark.id) continue;
    seen.push_back({landmark.id, (landmark.position_world - center).norm()});
  }
  std::sort(seen.begin(), seen.end(), [](const Range& a, const Range& b) { return a.landmark < b.landmark; });
  track.ranges = seen.size() * 2 >= track.reference_ranges.size()
                     ? std::move(seen)
                     : ranges_of(keyframe.landmarks, keyframe.cam_from_world);
}

std::vector<LiveMove> LiveTracker::move(const std::vector<LiveKeyframe>& keyframes) {
  std::map<std::int64_t, LiveMove> changed;
  std::vector<const LiveKeyframe*> still;  // their landmarks may have moved, as with the keyframe at the origin
  for (const LiveKeyframe& keyframe : keyframes) {
    const auto found = tracks_.find(keyframe.id);
    if (found == tracks_.end()) continue;
    Track& track = found->second;
    if (track.now.cam_from_world == keyframe.cam_from_world && track.map_id == keyframe.map_id) {
      if (!keyframe.landmarks.empty()) still.push_back(&keyframe);
      continue;
    }
    track.now.cam_from_world = keyframe.cam_from_world;
    if (track.map_id != keyframe.map_id) {
      Sequence& from = sequences_[track.map_id];
      from.erase(place(from, keyframe.id));
      Sequence& to = sequences_[keyframe.map_id];
      to.insert(place(to, keyframe.id), {keyframe.id, &track});
      track.map_id = keyframe.map_id;
    }
    measure_ranges(track, keyframe);
    changed[found->first] = {found->first, track.now, track.map_id};
  }
  if (changed.empty()) return {};
  for (const LiveKeyframe* keyframe : still) measure_ranges(tracks_.at(keyframe->id), *keyframe);
  std::map<std::int64_t, std::set<std::size_t>> moved;  // indices in the sequence, by map
  for (const auto& [id, place_now] : changed) {
    Sequence& sequence = sequences_[place_now.map_id];
    moved[place_now.map_id].insert(static_cast<std::size_t>(place(sequence, id) - sequence.begin()));
  }
  for (const auto& [map_id, numbers] : moved) recover(sequences_[map_id], numbers, changed);
  std::vector<LiveMove> result;
  result.reserve(changed.size());
  for (auto& [id, place] : changed) result.push_back(place);
  return result;
}

/// Whether the keyframe has moved too far from its reference state.
bool LiveTracker::has_moved_away(const Track& track) {
  double range = 0.0;
  if (track.reference_map_id != track.map_id) return true;
  if (!track.stores_ranges) return false;
  for (const Range& known : track.reference_ranges) range += known.range;
  if (track.reference_ranges.empty() || !(range > 0.0)) return true;
  range /= static_cast<double>(track.reference_ranges.size());
  return (track.now.cam_from_world.center() - track.reference.cam_from_world.center()).norm() > kFar * range;
}

/// Updates the scales of moved keyframes and of those around, whose baselines have changed, too. `sequence`: all
/// keyframes of a map; `moved`: indices of moved ones; `changed`: gets keyframes with a new scale.
void LiveTracker::recover(Sequence& sequence, const std::set<std::size_t>& moved,
                          std::map<std::int64_t, LiveMove>& changed) {
  constexpr std::size_t kReach = 2 * kScaleReach;
  for (auto first = moved.begin(); first != moved.end();) {
    auto last = first;  // of moved keyframes with overlapping surroundings
    while (std::next(last) != moved.end() && *std::next(last) <= *last + 2 * kReach) ++last;
    const std::size_t begin = *first > kReach ? *first - kReach : 0;
    const std::size_t end = std::min(sequence.size(), *last + kReach + 1);
    first = std::next(last);
    const std::size_t from = begin > kReach ? begin - kReach : 0;  // input of the estimate
    const std::size_t to = std::min(sequence.size(), end + kReach);
    std::vector<MovedKeyframe> keyframes;
    keyframes.reserve(to - from);
    for (std::size_t i = from; i < to; ++i) {
      const Track& track = *sequence[i].second;
      MovedKeyframe& keyframe = keyframes.emplace_back();
      keyframe.before = track.reference;
      keyframe.after = track.now.cam_from_world;
      keyframe.map_before = track.reference_map_id;
      compare_ranges(track.reference_ranges, track.ranges, keyframe);
    }
    const std::vector<double> scales = recover_scales(keyframes);
    bool far = false;
    for (std::size_t i = begin; i < end; ++i) {
      Track& track = *sequence[i].second;
      far = far || has_moved_away(track);
      const double scale = scales[i - from];
      if (scale == track.now.scale) continue;
      track.now.scale = scale;
      far = true;
      ++rescaled_;
      changed[sequence[i].first] = {sequence[i].first, track.now, track.map_id};
    }
    if (!far) continue;
    for (std::size_t i = begin; i < end; ++i) {
      Track& track = *sequence[i].second;
      for (Range& range : track.reference_ranges) range.range *= track.now.scale / track.reference.scale;
      if (!track.ranges.empty()) track.reference_ranges = track.ranges;
      track.reference = track.now;
      track.reference_map_id = track.map_id;
    }
  }
}

}  // namespace pmsp
