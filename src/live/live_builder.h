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

/// What a LiveDensifier's worker does, one piece of work at a time: which keyframes are used and what they are matched
/// with, passes of PatchMatch, points, and all of this again where something has changed. One thread only.
///
/// A keyframe's passes look at the newest maps of its neighbours, not at those of the pass before: so any pass can
/// follow any other, and one that is done again because poses have moved is a pass like others. What goes into a
/// result is recorded with it; what has changed since makes it due again.
class LiveBuilder {
 public:
  /// Takes points. `preliminary`: of a preview.
  using Publish = std::function<void(const KeyframeCloud& cloud, std::uint64_t serial, bool preliminary)>;

  /// Takes what is wrong with a keyframe that is left out for it.
  using OnError = std::function<void(const std::string&)>;

  /// `cancel` makes work return early; nothing may be asked of the builder after that. Throws as the LiveDensifier.
  LiveBuilder(const LiveOptions& options, const std::atomic<bool>& cancel, Publish publish, OnError on_error);

  /// `serial`: another one for each keyframe that is added, whatever its id.
  void add(const LiveKeyframe& keyframe, std::uint64_t serial);
  void move(const std::vector<LiveMove>& places);
  void set_landmarks(std::int64_t id, const std::vector<Landmark>& landmarks, const RigidTransform& cam_from_world);
  void erase(std::int64_t id);
  void finish() { finishing_ = true; }

  /// Lets go of what does not find room.
  void stay_within_memory();

  /// Does the next piece of work. Returns whether there was any.
  bool work();

  /// Keyframes that have been left out or erased since the last call, with their serials.
  using Dropped = std::vector<std::pair<std::int64_t, std::uint64_t>>;
  Dropped take_dropped() { return std::exchange(dropped_, {}); }

  LiveBacklog backlog() const;
  LiveStats stats() const;  ///< what is counted here
  const std::string& backend() const { return backend_; }

 private:
  using Sequence = std::vector<std::int64_t>;

  /// While no more keyframes than these lack passes, each gets all of them at once.
  static constexpr std::size_t kShortQueue = 6;
  /// Maximum number of keyframes whose points are computed together; those at the borders of a group are fused twice.
  static constexpr std::size_t kGroup = 8;
  /// Keyframes that have moved against each other by more than this since they were first shown saw one place as two;
  /// those that have moved less need no more than to be matched anew [rad].
  static constexpr double kReunion = 0.1;

  /// How far before and after its own place a keyframe looks [used keyframes of the flight].
  struct Reach {
    explicit Reach(const DensifierOptions& options);
    std::size_t neighbours;   ///< among these they are chosen
    std::size_t consistency;  ///< windows
    std::size_t fusion;
    std::size_t points;  ///< to those whose depth maps its points are made from
  };

  // Which are used (live_choices.cpp).
  bool has_ended(std::int64_t map_id) const;
  bool is_stable(const LiveNode& node) const;
  bool decide();
  bool is_crowded(const LiveNode& node) const;
  bool is_wanted(LiveNode& node, const Keyframe& keyframe);
  void use(LiveNode& node, const Keyframe& keyframe);
  void reselect_neighbours_around(const LiveNode& node);
  void leave_sequence(LiveNode& node);
  void drop(std::int64_t id);
  bool drop_late();
  bool link();
  void link(LiveNode& node);

  // Lenses and rig (live_calibration.cpp).
  void begin_with_lenses();
  void begin_with_rig();
  void collect_for_calibration(const LiveNode& node, const Keyframe& keyframe);
  bool estimate_rig();
  std::shared_ptr<const Image<std::uint8_t>> mask_for(int width, int height);
  void publish_cloud(const KeyframeCloud& cloud, std::uint64_t serial, bool preliminary) const;
  template <class Estimator>
  bool is_time_for(Estimator& estimator, std::size_t& looked_at) const;
  bool estimate_lenses();
  void use_lenses(double distance);

  // Depth maps.
  const LiveNode* neighbour(const LiveNode& node, std::int64_t id) const;
  std::vector<const LiveNode*> neighbours_of(const LiveNode& node) const;
  bool can_match(const LiveNode& node) const;
  int level_of(const LiveNode& node) const;
  bool lacks_passes(const LiveNode& node) const { return node.passes < full_ && can_match(node); }
  bool match();
  bool restarts(const LiveNode& node) const;
  bool needs_rematch(const LiveNode& node) const;
  LiveNode* previous_of(const LiveNode& node);
  bool match_again();
  void match(LiveNode& node);
  void filter(LiveNode& node);
  void fuse(LiveNode& node);

  // Points (live_points.cpp).
  int shared_level_of(const LiveNode& node) const;
  bool show(bool because_moved, std::size_t fewest);
  std::size_t group() const;
  bool show_wide();
  void show(const std::vector<LiveNode*>& nodes);
  void choose_test_views(LiveNode& node);
  std::vector<LiveNode*> with_depth(const std::vector<std::int64_t>& ids, std::int64_t map_id);

  // What changes.
  void detect_moves();
  void planes_changed(const LiveNode& node);
  bool is_outdated(const LiveNode& node, const LiveInputs& then, const LiveInputs& now) const;
  LiveInput input(const LiveNode& other, const LiveNode& own, std::uint64_t made) const;

  // Memory.
  void set_size(int image_width, int image_height);
  std::string why_too_little(const DensifierOptions& sized, int image_width) const;
  void make_room();
  std::size_t most_bytes() const;
  std::size_t bytes() const;

  LiveNode* find(std::int64_t id);
  const LiveNode* find(std::int64_t id) const;
  std::size_t place_of(const LiveNode& node) const;
  std::vector<LiveNode*> around(const LiveNode& node, std::size_t reach, bool with_depth);

  LiveOptions options_;
  DensifierOptions densifier_;  ///< in force
  const int full_;              ///< passes of a finished depth map
  const Reach reach_;
  const bool searches_all_;  ///< keyframes beyond the fusion window may make the point of a place in any case
  Publish publish_;
  OnError on_error_;
  EngineResults results_;
  DensifierStats engine_stats_;
  KeyframeSource image_again_;  ///< never set
  std::string backend_;
  std::unique_ptr<Engine> engine_;  ///< before the nodes, whose frames must not outlive it
  std::unique_ptr<LivePreview> preview_;
  std::map<std::int64_t, LiveNode> nodes_;       ///< that wait for a decision, or are used
  std::map<std::int64_t, Sequence> sequences_;   ///< ids of used ones in order, by map
  std::set<std::int64_t> undecided_;             ///< ids
  std::optional<LensDistanceEstimator> lenses_;  ///< while their distance is not fixed
  std::optional<RigMaskEstimator> rig_;          ///< while it is not fixed
  std::int64_t calibration_map_ = 0;             ///< of their keyframes
  std::size_t lens_keyframes_ = 0;               ///< keyframes of the last estimate
  std::size_t rig_keyframes_ = 0;
  Image<std::uint8_t> rig_mask_;                     ///< empty = none
  std::shared_ptr<const Image<std::uint8_t>> mask_;  ///< see mask_for
  const std::atomic<bool>& cancel_;
  Dropped dropped_;
  std::map<std::int64_t, std::int64_t> last_arrivals_;  ///< number of the last keyframe that came, by map
  std::int64_t arrivals_ = 0;
  std::uint64_t results_made_ = 0;
  bool finishing_ = false;
  bool moved_ = false;  ///< since moves were last looked for
  LiveStats stats_;
};

}  // namespace pmsp
