// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "planned_densifier.h"
#include "pmsp/calibration.h"
#include "pmsp/densifier.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/options.h"
#include "pmsp/stages.h"
#include "progress.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// Whether planes are worth storing for resumption: a GPU may produce them faster than a disk writes them, and again
/// faster than they are read and verified.
class PlanesPace {
 public:
  /// To be called for each keyframe before its planes are made. `options`: effective ones.
  bool is_worth_keeping(const DensifierOptions& options);

 private:
  using Clock = std::chrono::steady_clock;

  std::optional<Clock::time_point> first_;  ///< time of the first planes, which give no rate
  double bytes_ = 0.0;                      ///< size of planes since then
};

/// Returns a path relative to the workspace if possible, so that both can be moved together.
std::string relative_text(const std::filesystem::path& path, const std::filesystem::path& folder);

/// Run with --workspace: updates its content to the current mission. Members are to be called in order.
class WorkspaceStep {
 public:
  using TakeCloud = std::function<void(const KeyframeCloud&)>;

  /// All except `rig` must outlive it. `time`: account of the workspace's time; nullptr = none.
  WorkspaceStep(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
                const SlamMap& map, const RigMask& rig, bool growing, TimeAccount* time);

  /// Lists the images; returns keyframes whose images must be read. `unreadable`: have none.
  std::set<std::int64_t> new_images(const ImageSource& source, std::vector<SkippedKeyframe>& unreadable);
  /// Throws OutputError if almost nothing in the workspace can be kept: other mission or incompatible options. Not with
  /// --force, nor after a commit by this process. To be called after new_images.
  void refuse_losses() const;
  void add_image(const Keyframe& keyframe);  ///< with its image

  /// Begins a step in an empty workspace without deciding it; returns its name. `densifier`: of the run.
  std::string begin_run(const ImageSource& source, const Densifier& densifier);

  /// Loads the sharpness of a new image if a shard has stored it; returns whether it has.
  bool find_image_record(std::int64_t keyframe_id);
  void save_image_record(std::int64_t keyframe_id) const;

  /// Plans the step. Keyframes that should have been read, but were not, count as without image. Throws as the
  /// Densifier if the backend is unavailable. `engine`: that of the shards; "" = this machine.
  void decide(const std::string& engine = "");
  /// Records in the workspace what is about to be computed. To be called after decide().
  void begin() const;
  const workspace::Step& step() const { return step_; }
  const workspace::StepInputs& inputs() const { return inputs_; }

  /// Computes what is missing. `callbacks.cloud` receives all clouds, including kept ones, in the order of the plan.
  std::unique_ptr<PlannedDensifier> densifier(PlannedCallbacks callbacks);
  bool has_work() const { return !missing_.empty(); }
  std::int64_t depth_maps() const { return static_cast<std::int64_t>(step_.keyframes.size()); }
  /// Scale of the keyframe's current results.
  double scale_of(std::int64_t keyframe_id) const;

  /// For keyframes with a depth map: whether the step's final result exists.
  bool has_planes(std::int64_t keyframe_id) const;
  bool has_points(std::int64_t keyframe_id) const;
  /// Returns keyframes whose planes are missing for these points, except `without`.
  std::vector<std::int64_t> planes_lacking(const std::vector<std::int64_t>& points_of,
                                           const std::set<std::int64_t>& without) const;

  // Partial computation by shards: stores what these keyframes lack, and planes of others that are made on the way.
  std::unique_ptr<PlannedDensifier> planes_densifier(const std::vector<std::int64_t>& ids,
                                                     const std::function<void(std::int64_t keyframe_id)>& made) const;
  /// `planes_are_there`: planes_lacking() is empty.
  std::unique_ptr<PlannedDensifier> points_densifier(const std::vector<std::int64_t>& ids, bool planes_are_there,
                                                     const std::function<void(std::int64_t keyframe_id)>& made) const;

  /// Shards have computed everything. `is_repeated`: they were merged before.
  void join(bool is_repeated);

  /// Emits the remaining clouds.
  void finish();
  /// `lenses_looked_at`: Calibration::images.
  void commit(std::size_t lenses_looked_at, workspace::RecordedCloud cloud);

  /// Calls `take(id, width, height)` for each image of the mission.
  template <class Take>
  void each_image_size(const Take& take) const {
    for (const workspace::StepKeyframe& it : inputs_.keyframes) take(it.keyframe.id, it.width, it.height);
  }

  /// Totals of the whole mission.
  void count_keyframes(DensifierStats& stats) const;
  std::string summary() const;
  nlohmann::ordered_json report() const;

 private:
  void describe(const DensifierOptions& options, const std::string& engine, workspace::StepInputs& inputs) const;
  void refuse_loss(const workspace::Record& record, const std::string& whose, const workspace::StepInputs& inputs,
                   const std::map<std::int64_t, std::string>& images) const;
  void name_inputs(workspace::Record& record) const;
  void emit_clouds_before(std::optional<std::int64_t> keyframe_id);
  PlaneReuses find_reuses() const;
  PlaneReuses final_planes() const;
  void save(const PlaneMap& planes) const;
  void save(const KeyframeCloud& cloud) const;

  workspace::Workspace& workspace_;
  const Arguments& arguments_;
  DensifierOptions options_;  ///< of the arguments; after decide() with sizes, effective backend and simd
  const SlamMap& map_;
  TimeAccount* const time_;
  Executor executor_;
  std::vector<std::int64_t> ids_;  ///< keyframes with an image, in order
  std::map<std::int64_t, workspace::StepKeyframe> stock_;
  nlohmann::ordered_json rig_;  ///< see rig_json
  workspace::StepInputs inputs_;
  workspace::Step step_;
  std::set<std::int64_t> there_;       ///< keyframes with existing points
  std::vector<std::int64_t> missing_;  ///< keyframes whose points must be made
  PlaneReuses reuses_;
  bool is_joined_ = false;
  bool is_repeated_ = false;
  PlanesPace pace_;
  TakeCloud take_cloud_;
  std::size_t next_ = 0;  ///< index of the next cloud's entry in the plan
};

/// For runs with --delete-workspace in an empty workspace: otherwise as without workspace, but planes are stored under
/// the names that a WorkspaceStep expects, for resumption after a kill.
class PlaneMapWriter {
 public:
  /// All must outlive it. `options`: of the arguments.
  PlaneMapWriter(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
                 const SlamMap& map, const RigMask& rig, const ImageSource& source, TimeAccount& time);

  /// For PlannedCallbacks. `densifier`: the caller.
  bool wants_planes(const Densifier& densifier);
  void keep(const PlaneMap& planes, const Densifier& densifier);

 private:
  workspace::Workspace& workspace_;
  const Arguments& arguments_;
  const DensifierOptions options_;
  const SlamMap& map_;
  const RigMask& rig_;
  const ImageSource& source_;
  TimeAccount& time_;
  PlanesPace pace_;
  std::string step_;  ///< name, set at the first planes
};

}  // namespace pmsp::tool
