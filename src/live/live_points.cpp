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

/// Maximum number of keyframes in one wide duplicate removal, and minimum with `searches_all_` before finish().
constexpr std::size_t kWideGroup = 64;
constexpr std::size_t kWideFewest = 16;

}  // namespace

/// Returns the highest level (number of passes) reached by all keyframes whose depth maps affect its points, including
/// itself, except those that cannot be matched further; 0 = none, or these keyframes are not yet known.
int LiveBuilder::shared_level_of(const LiveNode& node) const {
  if (!node.has_map()) return 0;
  const std::size_t reach = reach_.points;
  const Sequence& sequence = sequences_.at(node.map_id);
  const std::size_t place = index_of(node);
  if (!has_ended(node.map_id) && place + reach >= sequence.size()) return 0;
  int level = level_of(node);
  for (std::size_t i = place > reach ? place - reach : 0; i < std::min(sequence.size(), place + reach + 1); ++i) {
    const LiveNode& other = nodes_.at(sequence[i]);
    if (other.phase == LivePhase::kSelected) return 0;
    if (other.phase == LivePhase::kMatching) level = std::min(level, level_of(other));
  }
  return level;
}

/// Number of keyframes whose points are computed together while others wait for passes: as many as have points, so that
/// the oldest are final early, up to kGroup.
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

/// Returns a group of keyframes that have reached a higher level than their points. `before_matching`: while passes of
/// few keyframes are run, the full level follows soon, and lower ones are skipped.
LiveBuilder::Ids LiveBuilder::next_points(bool before_matching) const {
  const auto matching =
      std::count_if(nodes_.begin(), nodes_.end(), [&](const auto& node) { return lacks_passes(node.second); });
  const bool soon_better = before_matching && matching > 0 && static_cast<std::size_t>(matching) <= kShortQueue;
  return first_group([&](const LiveNode& node) {
    if (node.published_passes >= full_) return false;
    const int level = shared_level_of(node);
    return level > node.published_passes && (!soon_better || level >= full_);
  });
}

/// Returns a group of keyframes whose points are stale.
LiveBuilder::Ids LiveBuilder::next_stale_points() const {
  return first_group([&](const LiveNode& node) {
    return node.stale.points && shared_level_of(node) >= std::max(node.published_passes, 1);
  });
}

/// Returns the keyframes of the next wide duplicate removal, beyond the fusion window.
LiveBuilder::Ids LiveBuilder::next_wide() const {
  Ids ids;
  for (const auto& [id, node] : nodes_) {
    if (ids.size() < kWideGroup && node.stale.duplicates && node.published_passes > 0 &&
        shared_level_of(node) >= node.published_passes)
      ids.push_back(id);
  }
  const std::size_t fewest = searches_all_ && !finishing_ ? kWideFewest : 1;
  return ids.size() >= fewest ? ids : Ids{};
}

/// Chooses viewers, the fusion window and others within reach on all sides, and duplicate views. Unless all keyframes
/// are searched, duplicates beyond the window are kept, as with `online`, except between keyframes that a loop closure
/// has brought together.
void LiveBuilder::choose_test_views(LiveNode& node) {
  std::vector<std::int64_t> window;
  for (const LiveNode* other : around(node, reach_.fusion, true)) {
    if (other != &node) window.push_back(other->id);
  }
  const Eigen::Vector3d center = node.pose.cam_from_world.center();
  std::vector<ViewerCandidate> candidates;
  for (const std::int64_t id : sequences_.at(node.map_id)) {
    const LiveNode& other = nodes_.at(id);
    if (&other == &node || !other.has_map()) continue;
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
    const auto stays_apart = [&](const ViewerCandidate& candidate) {
      const LiveNode& other = nodes_.at(candidate.id);
      const bool in_window = std::find(window.begin(), window.end(), candidate.id) != window.end();
      const LiveInput then{other.id, 0, other.first_pose, node.first_pose};
      return !in_window && (other.published_passes == 0 || node.published_passes == 0 ||
                            moved_angle(then, other.pose, node.pose, node.range) <= kLoopClosureMove);
    };
    candidates.erase(std::remove_if(candidates.begin(), candidates.end(), stays_apart), candidates.end());
  }
  node.duplicate_views = node.wide ? choose(node.duplicate_views) : window;
}

std::vector<LiveNode*> LiveBuilder::with_depth(const Ids& ids, std::int64_t map_id) {
  std::vector<LiveNode*> result;
  for (const std::int64_t id : ids) {
    LiveNode* const node = find(id);
    if (node != nullptr && node->has_map() && node->map_id == map_id) result.push_back(node);
  }
  return result;
}

/// Computes and publishes points. `wide`: without duplicates beyond the fusion window. Each round of duplicate removal
/// needs the previous round of the duplicate views.
void LiveBuilder::publish_points(const Ids& ids, bool wide) {
  const int rounds = duplicate_rounds(densifier_);
  std::vector<LiveNode*> nodes;
  for (const std::int64_t id : ids) {
    LiveNode& node = *nodes.emplace_back(&nodes_.at(id));
    if (wide) {
      node.wide = true;
      node.wide_pose = node.pose;
      node.stale.duplicates = false;
    } else {
      invalidate(node, LiveCause::kNewPoints);
    }
  }
  for (LiveNode* node : nodes) choose_test_views(*node);
  std::vector<std::vector<LiveNode*>> levels{nodes};  // keyframes of the last round, of the round before it, etc.
  std::set<std::int64_t> there;
  for (const LiveNode* node : nodes) there.insert(node->id);
  for (int round = 0; round < rounds; ++round) {
    std::vector<LiveNode*> more = levels.back();
    for (const LiveNode* node : levels.back()) {
      for (LiveNode* view : with_depth(node->duplicate_views, node->map_id)) {
        if (!there.insert(view->id).second) continue;
        if (view->duplicate_views.empty()) choose_test_views(*view);
        more.push_back(view);
      }
    }
    levels.push_back(std::move(more));
  }
  for (LiveNode* node : levels.back()) fuse(*node);
  for (LiveNode* node : levels.back()) {
    std::vector<const Engine::Frame*> viewers;
    for (LiveNode* viewer : with_depth(node->viewers, node->map_id)) {
      filter(*viewer);
      viewers.push_back(viewer->frame.get());
    }
    engine_->test_free_space(*node->frame, viewers);
  }
  for (int round = 1; round <= rounds; ++round) {
    for (LiveNode* node : levels[static_cast<std::size_t>(rounds - round)]) {
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
    node->published_passes = shared_level_of(*node);
    node->stale.points = false;
    node->restarted = node->restarted && node->published_passes < full_;
    node->tested.clear();
    for (const Ids* views : {&node->viewers, &node->duplicate_views}) {
      for (const LiveNode* other : with_depth(*views, node->map_id)) node->tested.push_back(input(*other, *node, 0));
    }
  }
  engine_->deliver(true);
}

}  // namespace pmsp
