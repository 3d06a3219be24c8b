// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <set>
#include <utility>

#include "live/live_builder.h"
#include "plan/choices.h"
#include "plan/reach.h"

// Points of a live mission: order of computation, viewers, duplicate views.
namespace pmsp {
namespace {

/// Maximum number of keyframes in one duplicate removal beyond the fusion window, and minimum with `searches_all_`
/// before finish().
constexpr std::size_t kMaxBeyondWindow = 64;
constexpr std::size_t kMinBeyondWindow = 16;

}  // namespace

/// Returns the fewest publishable passes of the keyframes whose depth maps affect its points, including itself; 0 =
/// none, or these keyframes are not yet known.
int LiveBuilder::shared_publishable_passes(const LiveNode& node) const {
  if (!node.has_depth_map()) return 0;
  const std::size_t reach = reach_.points;
  const Sequence& sequence = sequences_.at(node.map_id);
  const std::size_t place = index_of(node);
  if (!has_ended(node.map_id) && place + reach >= sequence.size()) return 0;
  int passes = publishable_passes(node);
  for (std::size_t i = place > reach ? place - reach : 0; i < std::min(sequence.size(), place + reach + 1); ++i) {
    const LiveNode& other = nodes_.at(sequence[i]);
    if (other.phase == LivePhase::kSelected) return 0;
    if (other.phase == LivePhase::kMatching) passes = std::min(passes, publishable_passes(other));
  }
  return passes;
}

/// Minimum group size while other keyframes lack passes: the number of published keyframes, 1 to kGroup, so that first
/// points appear early.
std::size_t LiveBuilder::group() const {
  const auto published =
      std::count_if(nodes_.begin(), nodes_.end(), [](const auto& node) { return node.second.published_passes > 0; });
  return std::clamp<std::size_t>(static_cast<std::size_t>(published), 1, kGroup);
}

/// Returns up to kGroup used keyframes, in order, for which `is_next` holds.
template <class IsNext>
LiveBuilder::Ids LiveBuilder::first_group(const IsNext& is_next) const {
  Ids ids;
  for (const auto& [map_id, sequence] : sequences_) {
    for (const std::int64_t id : sequence) {
      if (ids.size() < kGroup && is_next(nodes_.at(id))) ids.push_back(id);
    }
  }
  return ids;
}

/// Returns a group of keyframes with more publishable passes than their points. `before_matching`: with at most
/// kShortQueue keyframes lacking passes, only complete points are published, since these follow soon.
LiveBuilder::Ids LiveBuilder::next_points(bool before_matching) const {
  const auto matching =
      std::count_if(nodes_.begin(), nodes_.end(), [&](const auto& node) { return lacks_passes(node.second); });
  const bool soon_better = before_matching && matching > 0 && static_cast<std::size_t>(matching) <= kShortQueue;
  return first_group([&](const LiveNode& node) {
    if (node.published_passes >= full_) return false;
    const int passes = shared_publishable_passes(node);
    return passes > node.published_passes && (!soon_better || passes >= full_);
  });
}

/// Returns a group of keyframes whose points are stale.
LiveBuilder::Ids LiveBuilder::next_stale_points() const {
  return first_group([&](const LiveNode& node) {
    return node.stale.points && shared_publishable_passes(node) >= std::max(node.published_passes, 1);
  });
}

/// Returns the keyframes of the next duplicate removal beyond the fusion window.
LiveBuilder::Ids LiveBuilder::next_beyond_window() const {
  Ids ids;
  for (const auto& [id, node] : nodes_) {
    if (ids.size() < kMaxBeyondWindow && node.stale.duplicates && node.published_passes > 0 &&
        shared_publishable_passes(node) >= node.published_passes)
      ids.push_back(id);
  }
  const std::size_t fewest = searches_all_ && !finishing_ ? kMinBeyondWindow : 1;
  return ids.size() >= fewest ? ids : Ids{};
}

/// Chooses viewers, the fusion window and others within reach on all sides, and duplicate views. Unless all keyframes
/// are searched, duplicates beyond the window are kept, as with `online`, except between keyframes that a loop closure
/// has brought together.
void LiveBuilder::choose_viewers_and_duplicate_views(LiveNode& node) {
  std::vector<std::int64_t> window;
  for (const LiveNode* other : around(node, reach_.fusion, true)) {
    if (other != &node) window.push_back(other->id);
  }
  const Eigen::Vector3d center = node.pose.cam_from_world.center();
  std::vector<ViewerCandidate> candidates;
  for (const std::int64_t id : sequences_.at(node.map_id)) {
    const LiveNode& other = nodes_.at(id);
    if (&other == &node || !other.has_depth_map()) continue;
    candidates.push_back({id, (other.pose.cam_from_world.center() - center).norm()});
  }
  PlanKeyframe known;
  known.id = node.id;
  known.cam_from_world = node.pose.cam_from_world;
  known.landmarks = node.keyframe().landmarks;
  const PlanNode plan_node(std::move(known), 0);
  const auto choose = [&](const std::vector<std::int64_t>& before) {
    return choose_viewers(plan_node, window, candidates, densifier_.advanced.free_space.views, &before);
  };
  node.viewers = densifier_.advanced.free_space.enabled ? choose(node.viewers) : std::vector<std::int64_t>{};
  if (!searches_all_) {
    const auto is_excluded = [&](const ViewerCandidate& candidate) {
      const LiveNode& other = nodes_.at(candidate.id);
      const bool in_window = std::find(window.begin(), window.end(), candidate.id) != window.end();
      const LiveInput then{other.id, 0, other.first_pose, node.first_pose};
      return !in_window && (other.published_passes == 0 || node.published_passes == 0 ||
                            moved_angle(then, other.pose, node.pose, node.landmark_distance) <= kLoopClosureMove);
    };
    candidates.erase(std::remove_if(candidates.begin(), candidates.end(), is_excluded), candidates.end());
  }
  node.duplicate_views = node.beyond_window ? choose(node.duplicate_views) : window;
}

std::vector<LiveNode*> LiveBuilder::with_depth(const Ids& ids, std::int64_t map_id) {
  std::vector<LiveNode*> result;
  for (const std::int64_t id : ids) {
    LiveNode* const node = find(id);
    if (node != nullptr && node->has_depth_map() && node->map_id == map_id) result.push_back(node);
  }
  return result;
}

/// Computes and publishes points. `beyond_window`: without duplicates beyond the fusion window. Each round of duplicate
/// removal needs the previous round of the duplicate views.
void LiveBuilder::publish_points(const Ids& ids, bool beyond_window) {
  const int rounds = duplicate_rounds(densifier_);
  std::vector<LiveNode*> nodes;
  for (const std::int64_t id : ids) {
    LiveNode& node = *nodes.emplace_back(&nodes_.at(id));
    if (beyond_window) {
      node.beyond_window = true;
      node.beyond_window_pose = node.pose;
      node.stale.duplicates = false;
    } else {
      invalidate(node, LiveCause::kNewPoints);
    }
  }
  for (LiveNode* node : nodes) choose_viewers_and_duplicate_views(*node);
  std::vector<std::vector<LiveNode*>> keyframes_by_round{nodes};  // last round first; the last element is fused
  std::set<std::int64_t> there;
  for (const LiveNode* node : nodes) there.insert(node->id);
  for (int round = 0; round < rounds; ++round) {
    std::vector<LiveNode*> more = keyframes_by_round.back();
    for (const LiveNode* node : keyframes_by_round.back()) {
      for (LiveNode* view : with_depth(node->duplicate_views, node->map_id)) {
        if (!there.insert(view->id).second) continue;
        if (view->duplicate_views.empty()) choose_viewers_and_duplicate_views(*view);
        more.push_back(view);
      }
    }
    keyframes_by_round.push_back(std::move(more));
  }
  for (LiveNode* node : keyframes_by_round.back()) fuse(*node);
  for (LiveNode* node : keyframes_by_round.back()) {
    std::vector<const Engine::Frame*> viewers;
    for (LiveNode* viewer : with_depth(node->viewers, node->map_id)) {
      filter(*viewer);
      viewers.push_back(viewer->frame.get());
    }
    engine_->test_free_space(*node->frame, viewers);
  }
  for (int round = 1; round <= rounds; ++round) {
    for (LiveNode* node : keyframes_by_round[static_cast<std::size_t>(rounds - round)]) {
      std::vector<const Engine::Frame*> duplicate_views;
      for (const LiveNode* view : with_depth(node->duplicate_views, node->map_id))
        duplicate_views.push_back(view->frame.get());
      engine_->remove_duplicates(*node->frame, nearest_first(*node->frame, std::move(duplicate_views)), round);
    }
  }
  for (LiveNode* node : nodes) {
    if (cancel_.load(std::memory_order_relaxed)) return;
    engine_->emit(*node->frame);
    if (node->published_passes == 0) node->first_pose = node->pose;
    node->published_passes = shared_publishable_passes(*node);
    node->stale.points = false;
    node->is_rematched = node->is_rematched && node->published_passes < full_;
    node->tested_inputs.clear();
    for (const Ids* views : {&node->viewers, &node->duplicate_views}) {
      for (const LiveNode* other : with_depth(*views, node->map_id))
        node->tested_inputs.push_back(input(*other, *node, 0));
    }
  }
  engine_->deliver(true);
}

}  // namespace pmsp
