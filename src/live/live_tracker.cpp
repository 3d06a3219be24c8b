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
constexpr double kMaxReferenceMove = 0.02;

}  // namespace

LivePose LiveTracker::pose_of(std::int64_t id) const {
  const KeyframeState& state = keyframes_.at(id);
  return {id, state.now, state.map_id};
}

std::vector<std::int64_t> LiveTracker::ids() const {
  std::vector<std::int64_t> ids;
  ids.reserve(keyframes_.size());
  for (const auto& [id, state] : keyframes_) ids.push_back(id);
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

LiveTracker::Sequence::iterator LiveTracker::position_of(Sequence& sequence, std::int64_t id) {
  return std::lower_bound(sequence.begin(), sequence.end(), id,
                          [](const auto& one, std::int64_t of) { return one.first < of; });
}

std::uint64_t LiveTracker::serial_of(std::int64_t id) const {
  const auto found = keyframes_.find(id);
  return found == keyframes_.end() ? 0 : found->second.serial;
}

void LiveTracker::add(const LiveKeyframe& keyframe, std::uint64_t serial) {
  KeyframeState& state = keyframes_[keyframe.id];
  state.serial = serial;
  Sequence& sequence = sequences_[keyframe.map_id];
  sequence.insert(position_of(sequence, keyframe.id), {keyframe.id, &state});
  state.now = state.reference = {keyframe.cam_from_world, 1.0};
  state.map_id = state.reference_map_id = keyframe.map_id;
  state.ranges = state.reference_ranges = ranges_of(keyframe.landmarks, keyframe.cam_from_world);
}

void LiveTracker::erase(std::int64_t id) {
  const auto found = keyframes_.find(id);
  if (found == keyframes_.end()) return;
  Sequence& sequence = sequences_[found->second.map_id];
  sequence.erase(position_of(sequence, id));
  keyframes_.erase(found);
}

void LiveTracker::reset() {
  keyframes_.clear();
  sequences_.clear();
}

bool LiveTracker::is_recent(std::int64_t id, std::size_t count) const {
  const auto found = keyframes_.find(id);
  if (found == keyframes_.end()) return false;
  const Sequence& sequence = sequences_.at(found->second.map_id);
  return sequence.size() <= count || sequence[sequence.size() - count].first <= id;
}

void LiveTracker::forget_landmarks(std::int64_t id) {
  const auto found = keyframes_.find(id);
  if (found == keyframes_.end()) return;
  found->second.stores_ranges = false;
  std::vector<Range>().swap(found->second.ranges);
  std::vector<Range>().swap(found->second.reference_ranges);
}

/// Stores the current ranges: of the landmarks of the reference state if at least half of them are still observed, else
/// of landmarks spread evenly.
void LiveTracker::measure_ranges(KeyframeState& state, const LiveKeyframe& keyframe) {
  state.ranges.clear();
  if (keyframe.landmarks.empty() || !state.stores_ranges) return;
  std::vector<Range> seen;
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  std::bitset<1024> known;  // rejects most other landmarks quickly
  const auto bit = [&](std::int64_t id) { return static_cast<std::size_t>(id) % known.size(); };
  for (const Range& range : state.reference_ranges) known.set(bit(range.landmark));
  for (const Landmark& landmark : keyframe.landmarks) {
    if (!known.test(bit(landmark.id))) continue;
    const auto at = std::lower_bound(state.reference_ranges.begin(), state.reference_ranges.end(), landmark.id,
                                     [](const Range& range, std::int64_t id) { return range.landmark < id; });
    if (at == state.reference_ranges.end() || at->landmark != landmark.id) continue;
    seen.push_back({landmark.id, (landmark.position_world - center).norm()});
  }
  std::sort(seen.begin(), seen.end(), [](const Range& a, const Range& b) { return a.landmark < b.landmark; });
  state.ranges = !seen.empty() && seen.size() * 2 >= state.reference_ranges.size()
                     ? std::move(seen)
                     : ranges_of(keyframe.landmarks, keyframe.cam_from_world);
}

std::vector<LivePose> LiveTracker::move(const std::vector<LiveKeyframe>& keyframes) {
  std::map<std::int64_t, LivePose> changed;
  // Unchanged pose, but landmarks may have moved, e.g. of the keyframe at the origin.
  std::vector<const LiveKeyframe*> unmoved;
  for (const LiveKeyframe& keyframe : keyframes) {
    const auto found = keyframes_.find(keyframe.id);
    if (found == keyframes_.end()) continue;
    KeyframeState& state = found->second;
    if (state.now.cam_from_world == keyframe.cam_from_world && state.map_id == keyframe.map_id) {
      if (!keyframe.landmarks.empty()) unmoved.push_back(&keyframe);
      continue;
    }
    state.now.cam_from_world = keyframe.cam_from_world;
    if (state.map_id != keyframe.map_id) {
      Sequence& from = sequences_[state.map_id];
      from.erase(position_of(from, keyframe.id));
      Sequence& to = sequences_[keyframe.map_id];
      to.insert(position_of(to, keyframe.id), {keyframe.id, &state});
      state.map_id = keyframe.map_id;
    }
    measure_ranges(state, keyframe);
    changed[found->first] = {found->first, state.now, state.map_id};
  }
  if (changed.empty()) return {};
  for (const LiveKeyframe* keyframe : unmoved) measure_ranges(keyframes_.at(keyframe->id), *keyframe);
  std::map<std::int64_t, std::set<std::size_t>> moved;  // indices in the sequence, by map
  for (const auto& [id, pose_now] : changed) {
    Sequence& sequence = sequences_[pose_now.map_id];
    moved[pose_now.map_id].insert(static_cast<std::size_t>(position_of(sequence, id) - sequence.begin()));
  }
  for (const auto& [map_id, numbers] : moved) recover(sequences_[map_id], numbers, changed);
  std::vector<LivePose> result;
  result.reserve(changed.size());
  for (auto& [id, pose] : changed) result.push_back(pose);
  return result;
}

/// Whether the keyframe has moved too far from its reference state.
bool LiveTracker::has_moved_away(const KeyframeState& state) {
  double range = 0.0;
  if (state.reference_map_id != state.map_id) return true;
  if (!state.stores_ranges) return false;
  for (const Range& known : state.reference_ranges) range += known.range;
  if (state.reference_ranges.empty() || !(range > 0.0)) return true;
  range /= static_cast<double>(state.reference_ranges.size());
  return (state.now.cam_from_world.center() - state.reference.cam_from_world.center()).norm() >
         kMaxReferenceMove * range;
}

/// Updates the scales of moved keyframes and of those around, whose baselines have changed, too. `sequence`: all
/// keyframes of a map; `moved`: indices of moved ones; `changed`: gets keyframes with a new scale.
void LiveTracker::recover(Sequence& sequence, const std::set<std::size_t>& moved,
                          std::map<std::int64_t, LivePose>& changed) {
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
      const KeyframeState& state = *sequence[i].second;
      MovedKeyframe& keyframe = keyframes.emplace_back();
      keyframe.before = state.reference;
      keyframe.after = state.now.cam_from_world;
      keyframe.map_before = state.reference_map_id;
      compare_ranges(state.reference_ranges, state.ranges, keyframe);
    }
    const std::vector<double> scales = recover_scales(keyframes);
    bool renew_reference = false;
    for (std::size_t i = begin; i < end; ++i) {
      KeyframeState& state = *sequence[i].second;
      renew_reference = renew_reference || has_moved_away(state);
      const double scale = scales[i - from];
      if (scale == state.now.scale) continue;
      state.now.scale = scale;
      renew_reference = true;
      ++rescaled_;
      changed[sequence[i].first] = {sequence[i].first, state.now, state.map_id};
    }
    if (!renew_reference) continue;
    for (std::size_t i = begin; i < end; ++i) {
      KeyframeState& state = *sequence[i].second;
      for (Range& range : state.reference_ranges) range.range *= state.now.scale / state.reference.scale;
      if (!state.ranges.empty()) state.reference_ranges = state.ranges;
      state.reference = state.now;
      state.reference_map_id = state.map_id;
    }
  }
}

}  // namespace pmsp
