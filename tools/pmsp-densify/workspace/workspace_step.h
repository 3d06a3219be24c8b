// SPDX-License-Identifier: BSD-2-Clause
#pragma once

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
#include "planes_pace.h"
#include "planned_densifier.h"
#include "pmsp/calibration.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"
#include "time_account.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// A path relative to the workspace where that can be, so that both may be moved together.
std::string relative_text(const std::filesystem::path& path, const std::filesystem::path& folder);

/// One run with --workspace: from what lies there to the mission as it is now. In the order of the members.
class WorkspaceStep {
 public:
  using TakeCloud = std::function<void(const KeyframeCloud&)>;

  /// All but `rig` must outlive it. `time`: account of the time that the workspace takes; nullptr = none.
  WorkspaceStep(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
                const SlamMap& map, const RigMask& rig, bool growing, TimeAccount* time);

  /// Takes stock of the images; returns the keyframes whose images must be looked at. `unreadable` have none.
  std::set<std::int64_t> new_images(const ImageSource& source, std::vector<SkippedKeyframe>& unreadable);
  /// Throws OutputError where hardly anything that lies in the workspace can be kept: it is of another mission, or
  /// other options make it worthless. Not with --force, nor where this process has made it. After new_images.
  void refuse_losses() const;
  void look_at(const Keyframe& keyframe);  ///< with its image

  /// Begins this step where nothing lies in the workspace, for a run that does not need to know more than its name,
  /// which is returned. `densifier`: that of the run.
  std::string begin_run(const ImageSource& source, const Densifier& densifier);

  /// What a shard has seen of a new image, in place of looking at it; returns whether one has.
  bool find_look(std::int64_t keyframe_id);
  void save_look(std::int64_t keyframe_id) const;

  /// Decides what is to be done. Keyframes that were not looked at, but should have been, have no image. Throws as the
  /// Densifier does where the backend is not there. `engine`: of those who do it; "" = this machine.
  void decide(const std::string& engine = "");
  /// Once it is decided: says in the workspace what is about to be made.
  void begin() const;
  const workspace::Step& step() const { return step_; }
  const workspace::StepInputs& inputs() const { return inputs_; }

  /// For what is missing. `callbacks.cloud` is given all clouds, those that are kept, too, in the order of the plan.
  std::unique_ptr<PlannedDensifier> densifier(PlannedCallbacks callbacks);
  bool has_work() const { return !missing_.empty(); }
  std::int64_t depth_maps() const { return static_cast<std::int64_t>(step_.keyframes.size()); }
  /// Of what the keyframe has by now.
  double scale_of(std::int64_t keyframe_id) const;

  /// Of a keyframe with a depth map: whether what this step ends with is there by now.
  bool has_planes(std::int64_t keyframe_id) const;
  bool has_points(std::int64_t keyframe_id) const;
  /// Keyframes whose planes are behind these points and not there, but for those that have none.
  std::vector<std::int64_t> planes_lacking(const std::vector<std::int64_t>& points_of,
                                           const std::set<std::int64_t>& without) const;

  // Parts of the step: what these keyframes lack goes to the workspace, and planes of others that are made on the way.
  std::unique_ptr<PlannedDensifier> planes_densifier(const std::vector<std::int64_t>& ids,
                                                     const std::function<void(std::int64_t keyframe_id)>& made) const;
  /// `planes_are_there`: as `planes_lacking` says.
  std::unique_ptr<PlannedDensifier> points_densifier(const std::vector<std::int64_t>& ids, bool planes_are_there,
                                                     const std::function<void(std::int64_t keyframe_id)>& made) const;

  /// Shards have done all of it: nothing is missing. `is_repeated`: they were joined before.
  void join(bool is_repeated);

  /// Hands on the clouds that come after the last one made.
  void finish();
  /// `lenses_looked_at`: Calibration::images.
  void commit(std::size_t lenses_looked_at, workspace::RecordedCloud cloud);

  /// Calls `take(id, width, height)` for each image of the mission.
  template <class Take>
  void each_image_size(const Take& take) const {
    for (const workspace::StepKeyframe& it : inputs_.keyframes) take(it.keyframe.id, it.width, it.height);
  }

  /// Of the whole mission.
  void count_keyframes(DensifierStats& stats) const;
  std::string summary() const;
  nlohmann::ordered_json report() const;

 private:
  void describe(const DensifierOptions& options, const std::string& engine, workspace::StepInputs& inputs) const;
  void refuse_loss(const workspace::Record& record, const std::string& whose, const workspace::StepInputs& inputs,
                   const std::map<std::int64_t, std::string>& images) const;
  void name_inputs(workspace::Record& record) const;
  void hand_on_until(std::optional<std::int64_t> keyframe_id);
  Shortcuts find_shortcuts() const;
  Shortcuts final_planes() const;
  void save(const PlaneMap& planes) const;
  void save(const KeyframeCloud& cloud) const;

  workspace::Workspace& workspace_;
  const Arguments& arguments_;
  DensifierOptions options_;  ///< as told; once it is decided, with sizes, backend and simd in force
  const SlamMap& map_;
  TimeAccount* const time_;
  Executor executor_;
  std::vector<std::int64_t> ids_;  ///< of keyframes with an image, in order
  std::map<std::int64_t, workspace::StepKeyframe> stock_;
  nlohmann::ordered_json rig_;  ///< see rig_json
  workspace::StepInputs inputs_;
  workspace::Step step_;
  std::set<std::int64_t> there_;       ///< points that need not be made
  std::vector<std::int64_t> missing_;  ///< and those that must
  Shortcuts shortcuts_;
  bool is_joined_ = false;
  bool is_repeated_ = false;
  PlanesPace pace_;
  TakeCloud take_cloud_;
  std::size_t next_ = 0;  ///< entry of the plan whose cloud comes next
};

}  // namespace pmsp::tool
