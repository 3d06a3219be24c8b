// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include "live/live_builder.h"
#include "patchmatch/neighbours.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "view_filter/view_chain.h"

// Selection of the keyframes of a live mission and of their source views.
namespace pmsp {
namespace {

/// Distance within which keyframes count as redundant, relative to the median distance of the landmarks.
constexpr double kRedundantDistance = 0.15;
/// Maximum number of used keyframes within that distance.
constexpr int kEnough = 12;
/// Number of keyframes of other maps after which no more of this one are expected.
constexpr int kElsewhere = 8;
/// Number of previous used keyframes whose sharpness is compared.
constexpr std::size_t kSharpnessReach = 5;

}  // namespace

/// Whether no more keyframes of this map are expected: tracking continued in another map, or finish() was called.
bool LiveBuilder::has_ended(std::int64_t map_id) const {
  const auto last = last_arrivals_.find(map_id);
  return finishing_ || last == last_arrivals_.end() ||
         arrivals_ - last->second >= std::clamp(options_.stable_at_latest, 1, kElsewhere);
}

bool LiveBuilder::is_stable(const LiveNode& node, bool idle) const {
  const int at_latest =
      idle ? std::max(options_.stable_after, options_.stable_at_latest / 3) : options_.stable_at_latest;
  if (has_ended(node.map_id) || node.newer >= at_latest) return true;
  return node.newer >= options_.stable_after && (node.at_rest || options_.stable_after == 0);
}

/// Returns a keyframe that is the first pending one of its map and stable; nullptr = none.
const LiveNode* LiveBuilder::next_stable(bool idle) const {
  std::set<std::int64_t> maps;
  for (const auto& [id, node] : nodes_) {
    if (node.phase != LivePhase::kPending) continue;
    if (maps.insert(node.map_id).second && is_stable(node, idle)) return &node;
  }
  return nullptr;
}

/// Selects or drops a pending keyframe.
void LiveBuilder::decide(LiveNode& node) {
  Image<Rgb> converted;
  const auto mask = mask_for(node.image.width, node.image.height);
  const Keyframe keyframe = node.keyframe(mask.get(), converted);
  try {
    if (!is_crowded(node) && is_wanted(node, keyframe)) return select(node, keyframe);
    ++stats_.not_needed;
  } catch (const InvalidInput& error) {
    on_error_(error.what());
  }
  drop(node.id);
}

/// Whether enough keyframes around are used: bounds the memory of a mission that stays in one room.
bool LiveBuilder::is_crowded(const LiveNode& node) const {
  const auto sequence = sequences_.find(node.map_id);
  if (sequence == sequences_.end()) return false;
  const Eigen::Vector3d center = node.pose.cam_from_world.center();
  const double reach = kRedundantDistance * node.landmark_distance * node.pose.scale;
  return std::count_if(sequence->second.begin(), sequence->second.end(), [&](std::int64_t id) {
           return (nodes_.at(id).pose.cam_from_world.center() - center).norm() <= reach;
         }) >= kEnough;
}

/// Whether the view filter accepts it after the used keyframes before it, all at their current poses.
bool LiveBuilder::is_wanted(LiveNode& node, const Keyframe& keyframe) {
  node.sharpness = plan_keyframe(keyframe, densifier_, &engine_->executor()).sharpness;
  const Sequence& sequence = sequences_[node.map_id];
  const auto next = std::lower_bound(sequence.begin(), sequence.end(), node.id);
  if (!densifier_.advanced.view_filter.enabled || next == sequence.begin()) return true;
  const LiveNode& newest = nodes_.at(*std::prev(next));
  ViewChain chain(densifier_.advanced.view_filter);
  const Keyframe newest_keyframe = newest.keyframe();
  chain.add(newest_keyframe.landmarks, newest_keyframe.cam_from_world.center());
  const ViewChain::Verdict verdict = chain.compare(keyframe.landmarks, keyframe.cam_from_world.center());
  if (verdict.use != KeyframeUse::kDepthMap) return false;
  if (!verdict.redundant || densifier_.advanced.view_filter.min_sharpness == 0.0) return true;
  const std::size_t count = std::min<std::size_t>(kSharpnessReach, static_cast<std::size_t>(next - sequence.begin()));
  for (auto at = next - static_cast<std::ptrdiff_t>(count); at != next; ++at) {
    const SharpnessRecord& record = nodes_.at(*at).sharpness;
    if (!record.landmarks.empty()) chain.add_sharpness(record.landmarks);
  }
  return !chain.is_blurred(node.sharpness.landmarks);
}

void LiveBuilder::select(LiveNode& node, const Keyframe& keyframe) {
  if (densifier_.width == 0 || densifier_.height == 0) set_size(node.image.width, node.image.height);
  node.frame = engine_->prepare(keyframe);
  node.phase = LivePhase::kSelected;
  node.has_image = true;
  collect_for_calibration(node, keyframe);
  node.image = {};
  node.prior_depth.reset();
  ++stats_.used;
  Sequence& sequence = sequences_[node.map_id];
  sequence.insert(std::lower_bound(sequence.begin(), sequence.end(), node.id), node.id);
}

/// Makes unmatched keyframes around choose source views again.
void LiveBuilder::reselect_neighbours_around(const LiveNode& node) {
  for (LiveNode* other : around(node, reach_.neighbours, false)) {
    if (other->passes == 0 && other->has_image) other->phase = LivePhase::kSelected;
  }
}

void LiveBuilder::leave_sequence(LiveNode& node) {
  depth_map_changed(node);
  reselect_neighbours_around(node);
  Sequence& sequence = sequences_[node.map_id];
  sequence.erase(std::lower_bound(sequence.begin(), sequence.end(), node.id));
}

/// Removes the keyframe with all its data.
void LiveBuilder::drop(std::int64_t id) {
  LiveNode& node = nodes_.at(id);
  if (node.used()) leave_sequence(node);
  if (lenses_) lenses_->remove(id);
  if (rig_) rig_->remove(id);
  dropped_.emplace_back(id, node.serial);
  nodes_.erase(id);
}

/// If too many keyframes wait for their first depth map, or memory is full, drops the most redundant of them: the one
/// whose neighbours in the sequence are closest, relative to the distance of its landmarks. Returns whether one was
/// dropped.
bool LiveBuilder::drop_late() {
  int waiting = 0;
  std::int64_t least = 0;
  double least_gap = std::numeric_limits<double>::infinity();
  for (const auto& [map_id, sequence] : sequences_) {
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const LiveNode& node = nodes_.at(sequence[i]);
      if (!node.lacks_first_pass() || node.has_depth_map()) continue;
      ++waiting;
      if (i == 0 || i + 1 == sequence.size()) continue;
      const Eigen::Vector3d before = nodes_.at(sequence[i - 1]).pose.cam_from_world.center();
      const Eigen::Vector3d after = nodes_.at(sequence[i + 1]).pose.cam_from_world.center();
      const double gap = (after - before).norm() / std::max(node.landmark_distance * node.pose.scale, 1e-12);
      if (gap < least_gap) {
        least_gap = gap;
        least = node.id;
      }
    }
  }
  const bool any = least_gap < std::numeric_limits<double>::infinity();
  const bool full = bytes() > most_bytes();
  if (any && (full || waiting > options_.max_waiting)) {
    ++stats_.dropped_late;
    drop(least);
    return true;
  }
  if (!full || pending() < 2) return false;
  const auto first = std::find_if(nodes_.begin(), nodes_.end(),
                                  [](const auto& node) { return node.second.phase == LivePhase::kPending; });
  ++stats_.dropped_late;  // images of pending keyframes fill the memory
  drop(first->first);
  return true;
}

/// Returns the first selected keyframe with all candidates for its source views; nullptr = none.
const LiveNode* LiveBuilder::next_selected() const {
  for (const auto& [map_id, sequence] : sequences_) {
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const LiveNode& node = nodes_.at(sequence[i]);
      if (node.phase != LivePhase::kSelected) continue;
      if (i + reach_.neighbours >= sequence.size() && !has_ended(map_id)) break;
      return &node;
    }
  }
  return nullptr;
}

void LiveBuilder::choose_sources(LiveNode& node) {
  std::vector<Keyframe> keyframes;
  std::size_t own = 0;
  for (const LiveNode* around : this->around(node, reach_.neighbours, false)) {
    if (around != &node && !around->has_image) continue;
    if (around == &node) own = keyframes.size();
    keyframes.push_back(around->keyframe());
  }
  std::vector<const Keyframe*> sequence;
  for (const Keyframe& keyframe : keyframes) sequence.push_back(&keyframe);
  node.near.clear();
  for (const std::size_t k : choose_neighbours(sequence, own, densifier_.advanced.patchmatch.neighbours)) {
    node.near.push_back(sequence[k]->id);
  }
  node.depth_range = depth_range(keyframes[own], densifier_.advanced.init);
  const bool has_depth = !node.near.empty() && node.depth_range.max > node.depth_range.min;
  node.phase = has_depth ? LivePhase::kMatching : LivePhase::kNoDepth;
}

}  // namespace pmsp
