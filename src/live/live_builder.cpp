// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_builder.h"

#include <algorithm>
#include <utility>

#include "cost.h"
#include "densifier_checks.h"
#include "make_engine.h"
#include "plan/reach.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Maximum displacement of inputs for which points stay valid [px].
constexpr double kMaxInputMove = 0.1;
/// Displacement, relative to `max_move_px`, above which a photometric pass comes before the remaining ones; smaller
/// ones are corrected after these.
constexpr double kPhotometricFactor = 3.0;
/// Displacement, relative to `max_move_px`, above which a depth map is worthless, as after a loop closure, and matching
/// restarts; below, the remaining passes are run first.
constexpr double kRestartFactor = 24.0;
/// Displacement in the world above which a keyframe may overlap with others than before [rad].
constexpr double kMinWorldMove = 0.01;
/// Numbers of passes, besides `full_`, after which points are published.
constexpr int kPublishPasses[] = {2, 3};

DensifierOptions suitable(DensifierOptions options) {
  options.unordered = false;
  options.advanced.pipelined = false;
  options.scratch_folder.clear();
  options.advanced.expected_keyframes = 0;
  options.advanced.free_space.whole_mission = false;
  return options;
}

}  // namespace

LiveBuilder::Reach::Reach(const DensifierOptions& options) {
  const PlanReach reach = plan_reach(options);
  neighbours = static_cast<std::size_t>(reach.near);
  consistency = static_cast<std::size_t>(reach.consistency);
  fusion = static_cast<std::size_t>(reach.fusion);
  points = consistency + fusion;
}

LiveBuilder::LiveBuilder(const LiveOptions& options, const std::atomic<bool>& cancel, Publish publish, OnError on_error)
    : options_(options),
      densifier_(suitable(options.densifier)),
      full_(densifier_.advanced.patchmatch.geometric_passes + 1),
      reach_(densifier_),
      searches_all_(searches_whole_mission(options.densifier)),
      publish_(std::move(publish)),
      on_error_(std::move(on_error)),
      cancel_(cancel) {
  results_.cloud = [this](const KeyframeCloud& cloud) {
    ++stats_.clouds;
    publish_cloud(cloud, nodes_.at(cloud.keyframe_id).serial, false);
  };
  const std::string why_not = why_too_little(densifier_, kAnyImageWidth);
  if (!why_not.empty()) throw InvalidOption(why_not);
  engine_ = make_engine({densifier_, results_, engine_stats_, cancel_, reload_image_}, densifier_, backend_);
  if (options_.calibrate_lenses && densifier_.lens_distance == 0.0) begin_with_lenses();
  if (options_.find_rig) begin_with_rig();
  if (options_.previews) {
    preview_ = std::make_unique<LivePreview>(options_, cancel_, [this](const KeyframeCloud& cloud) {
      const LiveNode* const node = find(cloud.keyframe_id);
      if (node == nullptr || node->published_passes > 0) return;
      ++stats_.previews;
      publish_cloud(cloud, node->serial, true);
    });
  }
}

void LiveBuilder::set_size(int image_width, int image_height) {
  DensifierOptions sized = densifier_;
  fill_in_size(sized, image_width, image_height);  // throws before any change
  const std::string why_not = why_too_little(sized, image_width);
  if (!why_not.empty()) throw InvalidInput(why_not);
  densifier_ = sized;
  densifier_.backend = options_.densifier.backend;
  engine_ = make_engine({densifier_, results_, engine_stats_, cancel_, reload_image_}, densifier_, backend_);
}

/// Returns an error message if `memory_mib` is too small for the keyframes on which the points of one depend; else, or
/// while the size of the depth maps is unknown, an empty string.
std::string LiveBuilder::why_too_little(const DensifierOptions& sized, int image_width) const {
  if (sized.width == 0 || sized.height == 0) return {};
  const std::size_t keyframes = 1 + 2 * (reach_.points + reach_.neighbours);
  const double bytes = static_cast<double>(keyframes) * keyframe_memory(sized, image_width);
  const int needed = static_cast<int>(bytes / (1 << 20)) + 1;
  if (needed <= options_.memory_mib) return {};
  return "memory_mib is " + std::to_string(options_.memory_mib) + "; expected " + std::to_string(needed) +
         " or more, for " + std::to_string(keyframes) + " keyframes with depth maps of " + std::to_string(sized.width) +
         " x " + std::to_string(sized.height);
}

LiveNode* LiveBuilder::find(std::int64_t id) {
  const auto found = nodes_.find(id);
  return found == nodes_.end() ? nullptr : &found->second;
}
const LiveNode* LiveBuilder::find(std::int64_t id) const {
  const auto found = nodes_.find(id);
  return found == nodes_.end() ? nullptr : &found->second;
}

std::int64_t LiveBuilder::pending() const {
  return std::count_if(nodes_.begin(), nodes_.end(),
                       [](const auto& node) { return node.second.phase == LivePhase::kPending; });
}

/// Returns the index of a used keyframe in its sequence.
std::size_t LiveBuilder::index_of(const LiveNode& node) const {
  const Sequence& sequence = sequences_.at(node.map_id);
  return static_cast<std::size_t>(std::lower_bound(sequence.begin(), sequence.end(), node.id) - sequence.begin());
}

/// Returns the keyframes of the sequence up to `reach` before and after the node, including it, in order. `with_depth`:
/// only those with a depth map.
std::vector<LiveNode*> LiveBuilder::around(const LiveNode& node, std::size_t reach, bool with_depth) {
  const Sequence& sequence = sequences_.at(node.map_id);
  const std::size_t place = index_of(node);
  std::vector<LiveNode*> result;
  for (std::size_t i = place > reach ? place - reach : 0; i < std::min(sequence.size(), place + reach + 1); ++i) {
    LiveNode& other = nodes_.at(sequence[i]);
    if (with_depth && !other.has_depth_map()) continue;
    result.push_back(&other);
  }
  return result;
}

// ---- input ----

void LiveBuilder::add(const LiveKeyframe& keyframe, std::uint64_t serial) {
  finishing_ = false;
  last_arrivals_[keyframe.map_id] = ++arrivals_;
  for (auto& [id, node] : nodes_) {
    if (node.phase != LivePhase::kPending || node.map_id != keyframe.map_id) continue;
    ++node.newer;
    const Eigen::Vector3d center = node.pose.cam_from_world.center();
    node.at_rest =
        (center - node.newest_center).norm() <= options_.stable_move * node.landmark_distance * node.pose.scale;
    node.newest_center = center;
  }
  LiveNode& node = nodes_[keyframe.id];
  node.id = keyframe.id;
  node.serial = serial;
  node.map_id = keyframe.map_id;
  node.pose = {keyframe.cam_from_world, 1.0};
  node.newest_center = node.pose.cam_from_world.center();
  node.image = keyframe.image;
  node.pose_error = keyframe.pose_error;
  node.prior_depth = keyframe.prior_depth;
  node.take_landmarks(keyframe.landmarks, keyframe.cam_from_world);
  if (preview_) preview_->add(keyframe.id);
}

void LiveBuilder::set_landmarks(std::int64_t id, const std::vector<Landmark>& landmarks,
                                const RigidTransform& cam_from_world) {
  LiveNode* const node = find(id);
  if (node == nullptr || node->passes > 0) return;
  node->take_landmarks(landmarks, cam_from_world);
  if (node->used()) reselect_neighbours_around(*node);
}

void LiveBuilder::move(const std::vector<LivePose>& poses) {
  std::set<std::int64_t> left;  // keyframes that have left their map
  for (const LivePose& pose : poses) {
    LiveNode* const node = find(pose.keyframe_id);
    if (node == nullptr) continue;
    node->pose = pose.pose;
    if (node->frame) node->frame->pose = pose.pose;
    moved_ = true;
    if (node->map_id == pose.map_id) continue;
    left.insert(node->id);
    if (node->used()) leave_sequence(*node);
    node->map_id = pose.map_id;
    if (!node->used()) continue;
    Sequence& to = sequences_[pose.map_id];
    to.insert(std::lower_bound(to.begin(), to.end(), node->id), node->id);
    depth_map_changed(*node);
    reselect_neighbours_around(*node);
  }
  invalidate_viewed_by(left);
}

void LiveBuilder::erase(std::int64_t id) {
  LiveNode* const node = find(id);
  if (node == nullptr) return;
  if (preview_) preview_->erase(id);
  drop(id);
  invalidate_viewed_by({id});
}

/// Invalidates points tested against these keyframes, which are erased or have left their map.
void LiveBuilder::invalidate_viewed_by(const std::set<std::int64_t>& ids) {
  if (ids.empty()) return;
  const auto contains_any = [&](const Ids& views) {
    return std::any_of(views.begin(), views.end(), [&](std::int64_t id) { return ids.count(id) != 0; });
  };
  for (auto& [id, node] : nodes_) {
    if (contains_any(node.duplicate_views) || contains_any(node.viewers)) invalidate(node, LiveCause::kView);
  }
}

// ---- work ----

void LiveBuilder::stay_within_memory() {
  make_room();
  while (drop_late()) make_room();
}

LiveBuilder::Task LiveBuilder::next_task() const {
  // Previews, then selection and calibration, on which passes depend; these are fast.
  if (preview_ && preview_->has_work()) return {Step::kPreview, {}};
  if (const LiveNode* const node = next_stable(false)) return {Step::kDecide, {node->id}};
  if (lenses_ && is_estimate_due(lenses_->keyframes(), lens_keyframes_)) return {Step::kEstimateLenses, {}};
  if (rig_ && is_estimate_due(rig_->keyframes(), rig_keyframes_)) return {Step::kEstimateRig, {}};
  if (const LiveNode* const node = next_selected()) return {Step::kChooseSources, {node->id}};
  // Points of a complete group before further passes, so that the first points do not wait for all passes.
  if (Ids nodes = next_points(true); nodes.size() >= group()) return {Step::kPublish, std::move(nodes)};
  if (const LiveNode* const node = next_match()) return {Step::kMatch, {node->id}};
  if (Ids nodes = next_points(false); !nodes.empty()) return {Step::kPublish, std::move(nodes)};
  // Corrections, once all keyframes have their points.
  if (const LiveNode* const node = next_rematch()) return {Step::kRematch, {node->id}};
  if (Ids nodes = next_stale_points(); !nodes.empty()) return {Step::kPublish, std::move(nodes)};
  if (Ids nodes = next_beyond_window(); !nodes.empty()) return {Step::kPublishBeyondWindow, std::move(nodes)};
  if (const LiveNode* const node = next_stable(true)) return {Step::kDecide, {node->id}};
  return {};
}

bool LiveBuilder::work() {
  detect_moves();
  const Task task = next_task();
  const auto node = [&]() -> LiveNode& { return nodes_.at(task.nodes.front()); };
  switch (task.step) {
    case Step::kNone:
      return false;
    case Step::kPreview:
      preview_->work(nodes_, on_error_);
      break;
    case Step::kDecide:
      decide(node());
      break;
    case Step::kEstimateLenses:
      estimate_lenses();
      break;
    case Step::kEstimateRig:
      estimate_rig();
      break;
    case Step::kChooseSources:
      choose_sources(node());
      break;
    case Step::kMatch:
      match(node());
      break;
    case Step::kRematch:
      rematch(node());
      break;
    case Step::kPublish:
      publish_points(task.nodes, false);
      break;
    case Step::kPublishBeyondWindow:
      publish_points(task.nodes, true);
      break;
  }
  return true;
}

void LiveBuilder::invalidate(LiveNode& node, LiveCause cause) {
  if (!node.has_depth_map()) return;
  const bool published = node.published_passes > 0;
  const bool removes_duplicates = duplicate_rounds(densifier_) > 0;
  switch (cause) {
    case LiveCause::kView:
      node.stale.points |= published;
      break;
    case LiveCause::kDepthMap:
    case LiveCause::kRig:
      node.stale.points = true;
      break;
    case LiveCause::kInputs:
      node.stale.points = true;
      node.stale.duplicates |= removes_duplicates && searches_all_;
      break;
    case LiveCause::kNewPoints:
      node.stale.duplicates |= removes_duplicates && searches_all_;
      break;
    case LiveCause::kOverlap:
      node.stale.duplicates |= removes_duplicates && published;
      break;
    case LiveCause::kLenses:
      node.filtered_version = node.fused_version = 0;
      node.stale.points = true;
      if (!can_match(node)) break;
      node.stale.planes_px = node.extra_pass_px = 0.0;
      node.is_rematched = false;  // same priority as new keyframes
      node.last_pass_was_extra = false;
      node.passes = 0;
      break;
  }
}

void LiveBuilder::depth_map_changed(const LiveNode& node) {
  for (LiveNode* other : around(node, reach_.points, true)) invalidate(*other, LiveCause::kDepthMap);
}

LiveInput LiveBuilder::input(const LiveNode& other, const LiveNode& own, std::uint64_t version) const {
  return {other.id, version, other.pose, own.pose};
}

/// Whether inputs were replaced or have moved.
bool LiveBuilder::is_outdated(const LiveNode& node, const LiveInputs& then, const LiveInputs& now) const {
  if (then.size() != now.size()) return true;
  for (std::size_t i = 0; i < then.size(); ++i) {
    if (then[i].id != now[i].id || then[i].version != now[i].version) return true;
    if (moved_px(then[i], now[i].other, now[i].own, node.landmark_distance, densifier_.width) > kMaxInputMove)
      return true;
  }
  return false;
}

/// Marks depth maps and points stale whose inputs have moved.
void LiveBuilder::detect_moves() {
  if (!moved_) return;
  moved_ = false;
  std::set<std::int64_t> maps_with_moves;
  for (auto& [id, node] : nodes_) {
    if (!node.has_depth_map()) continue;
    const auto furthest = [&, &node = node](const LiveInputs& inputs) {
      double most = 0.0;
      for (const LiveInput& then : inputs) {
        const LiveNode* const other = find(then.id);
        if (other == nullptr || other->map_id != node.map_id) continue;
        most = std::max(most, moved_px(then, other->pose, node.pose, node.landmark_distance, densifier_.width));
      }
      return most;
    };
    const double moved = furthest(node.matched_inputs);
    if (moved > options_.max_move_px) node.stale.planes_px = moved;
    if (node.published_passes == 0) continue;
    if (std::max(furthest(node.fused_inputs), furthest(node.tested_inputs)) > kMaxInputMove)
      invalidate(node, LiveCause::kInputs);
    // The other frame is the world.
    const LiveInput pose_then{id, 0, KeyframePose{}, node.beyond_window ? node.beyond_window_pose : node.first_pose};
    if (moved_angle(pose_then, KeyframePose{}, node.pose, node.landmark_distance) > kMinWorldMove)
      maps_with_moves.insert(node.map_id);
  }
  for (auto& [id, node] : nodes_) {
    if (maps_with_moves.count(node.map_id) != 0) invalidate(node, LiveCause::kOverlap);
  }
}

// ---- depth maps ----

/// Returns the keyframe with this id if `node` can be matched with it, else nullptr.
const LiveNode* LiveBuilder::neighbour(const LiveNode& node, std::int64_t id) const {
  const LiveNode* const near = find(id);
  return near != nullptr && near->has_image && near->map_id == node.map_id ? near : nullptr;
}

std::vector<const LiveNode*> LiveBuilder::neighbours_of(const LiveNode& node) const {
  std::vector<const LiveNode*> result;
  for (const std::int64_t id : node.near) {
    const LiveNode* const near = neighbour(node, id);
    if (near != nullptr) result.push_back(near);
  }
  return result;
}

bool LiveBuilder::can_match(const LiveNode& node) const {
  if (node.phase != LivePhase::kMatching || !node.has_image) return false;
  return std::any_of(node.near.begin(), node.near.end(),
                     [&](std::int64_t id) { return neighbour(node, id) != nullptr; });
}

/// Returns the largest number of passes, completed by the keyframe, after which points are published; 0 = none, `full_`
/// if it cannot be matched further.
int LiveBuilder::publishable_passes(const LiveNode& node) const {
  if (!lacks_passes(node)) return full_;
  int passes = 0;
  for (const int each : kPublishPasses) {
    if (node.passes >= each) passes = each;
  }
  return passes;
}

/// Returns the next keyframe to match: the first one if at most kShortQueue lack passes, else one with the fewest
/// publishable passes. Rematched keyframes with points come last. Geometric passes wait for the previous pass of the
/// source views and, after the first points, for their extra photometric passes. After a restart they also wait until
/// the source views have restarted.
const LiveNode* LiveBuilder::next_match() const {
  std::vector<const LiveNode*> candidates;
  for (const auto& [map_id, sequence] : sequences_) {
    for (const std::int64_t id : sequence) {
      const LiveNode& node = nodes_.at(id);
      if (!lacks_passes(node) || must_restart(node)) continue;
      candidates.push_back(&node);
    }
  }
  const double photometric_px = kPhotometricFactor * options_.max_move_px;
  const bool all_at_once = candidates.size() <= kShortQueue;
  const LiveNode* best = nullptr;
  for (const LiveNode* node : candidates) {
    const std::vector<const LiveNode*> near = neighbours_of(*node);
    const bool ready = std::all_of(near.begin(), near.end(), [&](const LiveNode* other) {
      if (node->passes == 0 || node->needs_photometric_pass(photometric_px)) return true;
      if (other->phase == LivePhase::kSelected || (other->passes < node->passes && lacks_passes(*other))) return false;
      if (node->passes >= kPublishPasses[0] && must_restart(*other)) return false;
      const bool has_points = node->published_passes > 0;
      if (node->is_rematched && (has_points ? needs_rematch(*other) : must_restart(*other))) return false;
      const bool waits = other->needs_photometric_pass(photometric_px) && can_match(*other);
      return (node->passes < kPublishPasses[0] && !(node->is_rematched && has_points)) ||
             !waits;  // first points do not wait for photometric passes
    });
    if (!ready) continue;
    const auto rank = [&](const LiveNode& of) {
      return (all_at_once ? 0 : publishable_passes(of)) + (of.is_rematched && of.published_passes > 0 ? full_ : 0);
    };
    if (best == nullptr || rank(*node) < rank(*best)) best = node;
  }
  return best;
}

/// Whether source views have moved so far that its depth map is worthless.
bool LiveBuilder::must_restart(const LiveNode& node) const {
  return node.passes > 0 && node.stale.planes_px > kRestartFactor * options_.max_move_px && can_match(node);
}

/// Whether all passes must be run again, since source views have moved. Unless must_restart, after the remaining
/// passes.
bool LiveBuilder::needs_rematch(const LiveNode& node) const {
  return must_restart(node) || (node.passes >= full_ && node.rematch_px() > 0.0 && can_match(node));
}

/// Returns the previous keyframe of its sequence; nullptr for the first one.
const LiveNode* LiveBuilder::previous_of(const LiveNode& node) const {
  const std::size_t place = index_of(node);
  return place > 0 ? find(sequences_.at(node.map_id)[place - 1]) : nullptr;
}

/// Returns the keyframe with the largest displacement among those that must be matched again. Previous ones that
/// restart, too, come first: their planes are the start of the next.
const LiveNode* LiveBuilder::next_rematch() const {
  const LiveNode* worst = nullptr;
  for (const auto& [id, node] : nodes_) {
    if (!needs_rematch(node)) continue;
    if (worst == nullptr || node.rematch_px() > worst->rematch_px()) worst = &node;
  }
  if (worst == nullptr) return nullptr;
  for (const LiveNode* before = previous_of(*worst); before != nullptr && must_restart(*before);
       before = previous_of(*worst)) {
    worst = before;
  }
  return worst;
}

/// Matches a keyframe again, from the first pass.
void LiveBuilder::rematch(LiveNode& node) {
  ++stats_.matched_again;
  node.is_rematched = node.published_passes > 0 || must_restart(node);
  node.passes = 0;
  node.extra_pass_px = 0.0;
  match(node);
}

/// Runs the next pass.
void LiveBuilder::match(LiveNode& node) {
  const Keyframe keyframe = node.keyframe();
  Engine::MatchTask task;
  task.reference = node.frame.get();
  task.keyframe = &keyframe;
  LiveInputs inputs;
  // Depth maps from before a move agree with each other and would keep the planes at old positions. Such source views
  // provide images only, and an extra photometric pass is run.
  const double photometric_px = kPhotometricFactor * options_.max_move_px;
  std::vector<const LiveNode*> neighbours = neighbours_of(node);
  const auto outdated = std::stable_partition(neighbours.begin(), neighbours.end(), [&](const LiveNode* near) {
    return near->stale.planes_px <= photometric_px;
  });
  for (const LiveNode* near : neighbours) {
    task.neighbours.push_back(near->frame.get());
    inputs.push_back(input(*near, node, near->planes_version));
  }
  const bool is_extra_pass = node.needs_photometric_pass(photometric_px);
  if (is_extra_pass) node.extra_pass_px = node.stale.planes_px;
  const bool photometric = node.passes == 0 || is_extra_pass;
  task.num_with_planes = photometric ? 0 : static_cast<std::size_t>(outdated - neighbours.begin());
  task.range = node.depth_range;
  if (node.passes == 0 && densifier_.advanced.init.warp_previous) {
    const LiveNode* const previous = previous_of(node);
    if (previous != nullptr && previous->has_depth_map() && !must_restart(*previous))
      task.previous = previous->frame.get();
  }
  task.pass = std::min(node.passes, std::max(1, full_ - 1));
  task.skip_weighted_median = node.passes + 1 < std::min(kPublishPasses[0], full_);
  engine_->match(task);
  if (!node.frame->matched) return;  // cancelled
  ++stats_.passes;
  node.last_pass_was_extra = is_extra_pass;
  if (!is_extra_pass) ++node.passes;
  node.planes_version = ++last_result_;
  if (photometric) {
    node.matched_inputs = std::move(inputs);
    node.stale.planes_px = 0.0;
  }
  depth_map_changed(node);
}

void LiveBuilder::filter(LiveNode& node) {
  std::vector<const Engine::Frame*> others;
  LiveInputs inputs{input(node, node, node.planes_version)};
  for (const LiveNode* other : around(node, reach_.consistency, true)) {
    if (other == &node) continue;
    others.push_back(other->frame.get());
    inputs.push_back(input(*other, node, other->planes_version));
  }
  if (node.filtered_version != 0 && !is_outdated(node, node.filtered_inputs, inputs)) return;
  engine_->filter(*node.frame, others);
  node.filtered_inputs = std::move(inputs);
  node.filtered_version = ++last_result_;
}

void LiveBuilder::fuse(LiveNode& node) {
  const std::vector<LiveNode*> window = around(node, reach_.fusion, true);
  LiveInputs inputs;
  std::vector<const Engine::Frame*> frames;
  for (LiveNode* other : window) {
    filter(*other);
    inputs.push_back(input(*other, node, other->filtered_version));
    frames.push_back(other->frame.get());
  }
  if (node.fused_version != 0 && !is_outdated(node, node.fused_inputs, inputs)) return;
  const auto current = std::find(window.begin(), window.end(), &node);
  engine_->fuse(*node.frame, frames, static_cast<std::size_t>(current - window.begin()));
  node.fused_inputs = std::move(inputs);
  node.fused_version = ++last_result_;
}

// ---- memory ----

std::size_t LiveBuilder::most_bytes() const { return static_cast<std::size_t>(options_.memory_mib) << 20U; }

std::size_t LiveBuilder::bytes() const {
  std::size_t bytes = (lenses_ ? lenses_->bytes() : 0) + (rig_ ? rig_->bytes() : 0);
  for (const auto& [id, node] : nodes_) {
    if (node.image.data != nullptr) {
      const std::size_t channels = node.image.format == PixelFormat::kGray ? 1 : 3;
      bytes += static_cast<std::size_t>(node.image.height) * static_cast<std::size_t>(node.image.width) * channels;
    }
    if (node.prior_depth) bytes += node.prior_depth->size() * sizeof(float);
    for (const Engine::Frame* frame : {node.frame.get(), node.preview.get()}) bytes += frame ? frame->bytes() : 0;
  }
  return bytes;
}

/// Releases images, then all other data, of keyframes that are published or have no depth, the farthest from the newest
/// first.
void LiveBuilder::make_room() {
  const std::size_t most = most_bytes();
  std::size_t now = bytes();
  if (now <= most || nodes_.empty()) return;
  const Eigen::Vector3d center = nodes_.rbegin()->second.pose.cam_from_world.center();
  std::vector<std::pair<double, LiveNode*>> order;  // farthest first
  for (auto& [id, node] : nodes_) {
    if (!node.frame || (node.published_passes == 0 && node.phase != LivePhase::kNoDepth)) continue;
    const std::vector<LiveNode*> near = around(node, reach_.neighbours, false);
    const auto needs_views = [](const LiveNode* other) { return other->lacks_first_pass(); };
    if (std::any_of(near.begin(), near.end(), needs_views)) continue;  // still needed as source view
    order.emplace_back(-(node.pose.cam_from_world.center() - center).norm(), &node);
  }
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : a.second->id < b.second->id;
  });
  for (const auto& [distance, node] : order) {
    if (now <= most) return;
    if (!node->has_image) continue;
    now -= node->frame->bytes();
    engine_->release(*node->frame, Artefact::kImage);
    now += node->frame->bytes();
    node->has_image = false;
    ++stats_.images_dropped;
  }
  for (const auto& [distance, node] : order) {
    if (now <= most) return;
    now -= node->frame->bytes();
    node->frame.reset();
    node->phase = LivePhase::kFrozen;
    node->stale = {};
    ++stats_.keyframes_frozen;
  }
}

LiveBacklog LiveBuilder::backlog() const {
  LiveBacklog backlog;
  backlog.unstable = pending();
  for (const auto& [id, node] : nodes_) {
    if (node.phase != LivePhase::kSelected && node.phase != LivePhase::kMatching) continue;
    if (node.published_passes == 0) {
      ++backlog.waiting;
    } else if (node.stale.points || node.stale.duplicates || lacks_passes(node) ||
               (node.rematch_px() > 0.0 && can_match(node))) {
      ++backlog.refining;
    }
  }
  return backlog;
}

LiveStats LiveBuilder::stats() const {
  LiveStats stats = stats_;
  if (preview_) stats.previews_late = preview_->late();
  stats.lens_distance = densifier_.lens_distance;
  stats.memory_mib = static_cast<std::int64_t>(bytes() >> 20U);
  return stats;
}

}  // namespace pmsp
