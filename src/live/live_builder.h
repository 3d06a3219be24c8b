// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine.h"
#include "live/live_map.h"
#include "live/live_node.h"
#include "live/live_preview.h"
#include "planned_densifier.h"
#include "pmsp/calibration.h"
#include "pmsp/live.h"

namespace pmsp {

/// Work of a LiveDensifier, one task at a time: selection of keyframes and source views, passes of PatchMatch, points,
/// and updates of these after changes. Not thread-safe.
///
/// Passes use the newest maps of the source views, not those of the previous pass: any pass can follow any other, and
/// rematching after a pose update needs no other code. Results record their inputs, and are stale once these change.
class LiveBuilder {
 public:
  /// Receiver of points. `serial`: of the keyframe; `preliminary`: of a preview.
  using Publish = std::function<void(const KeyframeCloud& cloud, std::uint64_t serial, bool preliminary)>;

  /// Receiver of messages about invalid keyframes, which are skipped.
  using OnError = std::function<void(const std::string&)>;

  /// A true `cancel` makes `work` return early; the builder must then be replaced. Throws as LiveDensifier.
  LiveBuilder(const LiveOptions& options, const std::atomic<bool>& cancel, Publish publish, OnError on_error);

  /// `serial`: unique among all added keyframes, even if an id is reused.
  void add(const LiveKeyframe& keyframe, std::uint64_t serial);
  void move(const std::vector<LivePose>& poses);
  void set_landmarks(std::int64_t id, const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world);
  void erase(std::int64_t id);
  void finish() { finishing_ = true; }

  /// Releases data and drops keyframes until `memory_mib` and `max_waiting` are met, as far as possible.
  void stay_within_memory();

  /// Runs the next task. Returns whether there was one.
  bool work();

  /// Keyframes dropped or erased since the last call, with their serials.
  using Dropped = std::vector<std::pair<std::int64_t, std::uint64_t>>;
  Dropped take_dropped() { return std::exchange(dropped_, {}); }

  LiveBacklog backlog() const;
  LiveStats stats() const;  ///< counts of the builder only
  const std::string& backend() const { return backend_; }

 private:
  using Sequence = std::vector<std::int64_t>;  ///< ids of the used keyframes of a map, in order

  /// Maximum number of keyframes lacking passes up to which each gets all its passes at once.
  static constexpr std::size_t kShortQueue = 6;
  /// Maximum number of keyframes whose points are computed together; those at the borders of a group are fused twice.
  static constexpr std::size_t kGroup = 8;
  /// Relative displacement of two keyframes, since their points were first published, above which they may have mapped
  /// one surface twice, as before a loop closure; below, rematching suffices [rad].
  static constexpr double kLoopClosureMove = 0.1;

  /// Maximum distance in the sequence, on either side [used keyframes].
  struct Reach {
    explicit Reach(const DensifierOptions& options);
    std::size_t neighbours;   ///< candidates for source views
    std::size_t consistency;  ///< consistency window
    std::size_t fusion;       ///< fusion window
    std::size_t points;       ///< depth maps that affect a keyframe's points
  };

  /// Kinds of tasks.
  enum class Step {
    kNone,
    kPreview,  ///< of the newest keyframe
    kDecide,   ///< kPending -> kSelected, or drop
    kEstimateLenses,
    kEstimateRig,
    kChooseSources,       ///< kSelected -> kMatching or kNoDepth
    kMatch,               ///< next pass
    kRematch,             ///< first pass again
    kPublish,             ///< points
    kPublishBeyondWindow  ///< points without duplicates beyond the fusion window
  };
  using Ids = std::vector<std::int64_t>;
  struct Task {
    Step step = Step::kNone;
    Ids nodes;
  };

  /// Returns the most urgent task; kNone = idle.
  Task next_task() const;

  /// Marks results stale, except depth maps of moved source views (detect_moves).
  void invalidate(LiveNode& node, LiveCause cause);
  void depth_map_changed(const LiveNode& node);  ///< invalidates points that depend on the node's depth map
  void invalidate_viewed_by(const std::set<std::int64_t>& ids);
  void detect_moves();

  // Selection (live_choices.cpp).
  bool has_ended(std::int64_t map_id) const;
  bool is_stable(const LiveNode& node, bool idle) const;
  const LiveNode* next_stable(bool idle) const;
  void decide(LiveNode& node);
  bool is_crowded(const LiveNode& node) const;
  bool is_wanted(LiveNode& node, const Keyframe& keyframe);
  void select(LiveNode& node, const Keyframe& keyframe);
  void reselect_neighbours_around(const LiveNode& node);
  void leave_sequence(LiveNode& node);
  void drop(std::int64_t id);
  bool drop_late();
  const LiveNode* next_selected() const;
  void choose_sources(LiveNode& node);

  // Lenses and rig (live_calibration.cpp).
  void begin_with_lenses();
  void begin_with_rig();
  void collect_for_calibration(const LiveNode& node, const Keyframe& keyframe);
  std::shared_ptr<const Image<std::uint8_t>> mask_for(int width, int height);
  void publish_cloud(const KeyframeCloud& cloud, std::uint64_t serial, bool preliminary) const;
  bool is_estimate_due(std::size_t count, std::size_t previous) const;
  template <class Estimator>
  void update_poses(Estimator& estimator) const;
  void estimate_rig();
  void estimate_lenses();
  void set_lens_distance(double distance);

  // Depth maps.
  const LiveNode* neighbour(const LiveNode& node, std::int64_t id) const;
  std::vector<const LiveNode*> neighbours_of(const LiveNode& node) const;
  bool can_match(const LiveNode& node) const;
  int publishable_passes(const LiveNode& node) const;
  bool lacks_passes(const LiveNode& node) const { return node.passes < full_ && can_match(node); }
  bool must_restart(const LiveNode& node) const;
  bool needs_rematch(const LiveNode& node) const;
  const LiveNode* previous_of(const LiveNode& node) const;
  const LiveNode* next_match() const;
  const LiveNode* next_rematch() const;
  void match(LiveNode& node);
  void rematch(LiveNode& node);
  void filter(LiveNode& node);
  void fuse(LiveNode& node);

  // Points (live_points.cpp).
  int shared_publishable_passes(const LiveNode& node) const;
  std::size_t group() const;
  template <class IsNext>
  Ids first_group(const IsNext& is_next) const;
  Ids next_points(bool before_matching) const;
  Ids next_stale_points() const;
  Ids next_beyond_window() const;
  void publish_points(const Ids& ids, bool beyond_window);
  void choose_viewers_and_duplicate_views(LiveNode& node);
  std::vector<LiveNode*> with_depth(const Ids& ids, std::int64_t map_id);

  bool is_outdated(const LiveNode& node, const LiveInputs& then, const LiveInputs& now) const;
  LiveInput input(const LiveNode& other, const LiveNode& own, std::uint64_t version) const;

  // Memory.
  void set_size(int image_width, int image_height);
  std::string why_too_little(const DensifierOptions& sized, int image_width) const;
  void make_room();
  std::size_t most_bytes() const;
  std::size_t bytes() const;

  LiveNode* find(std::int64_t id);
  const LiveNode* find(std::int64_t id) const;
  std::int64_t pending() const;  ///< number of pending keyframes
  std::size_t index_of(const LiveNode& node) const;
  std::vector<LiveNode*> around(const LiveNode& node, std::size_t reach, bool with_depth);

  LiveOptions options_;
  DensifierOptions densifier_;  ///< in effect
  const int full_;              ///< number of passes of a complete depth map
  const Reach reach_;
  const bool searches_all_;  ///< duplicates are removed among all keyframes, not only after loop closures
  Publish publish_;
  OnError on_error_;
  EngineResults results_;
  DensifierStats engine_stats_;
  KeyframeSource reload_image_;  ///< empty: the engine retains prepared images
  std::string backend_;
  std::unique_ptr<Engine> engine_;  ///< declared before the nodes, whose frames must not outlive it
  std::unique_ptr<LivePreview> preview_;
  std::map<std::int64_t, LiveNode> nodes_;       ///< pending and used keyframes
  std::map<std::int64_t, Sequence> sequences_;   ///< by map
  std::optional<LensDistanceEstimator> lenses_;  ///< until the distance is fixed
  std::optional<RigMaskEstimator> rig_;          ///< until the mask is fixed
  std::int64_t calibration_map_ = 0;             ///< map of the keyframes of both estimators
  std::size_t lens_keyframes_ = 0;               ///< number of keyframes of the last estimate
  std::size_t rig_keyframes_ = 0;
  Image<std::uint8_t> rig_mask_;                     ///< empty = none
  std::shared_ptr<const Image<std::uint8_t>> mask_;  ///< cached result of mask_for
  const std::atomic<bool>& cancel_;
  Dropped dropped_;
  std::map<std::int64_t, std::int64_t> last_arrivals_;  ///< `arrivals_` at the newest keyframe, by map
  std::int64_t arrivals_ = 0;
  std::uint64_t last_result_ = 0;
  bool finishing_ = false;
  bool moved_ = false;  ///< poses have changed since detect_moves
  LiveStats stats_;
};

}  // namespace pmsp
