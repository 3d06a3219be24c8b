// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/api.h"
#include "pmsp/options.h"
#include "workspace/record.h"

namespace pmsp::workspace {

/// Keyframe of the current mission.
struct StepKeyframe {
  PlanKeyframe keyframe;
  std::string image;          ///< fingerprint
  int width = 0, height = 0;  ///< of the image [px]
  std::string looked_for;     ///< options of the sharpness
};

/// Inputs of a step, without the workspace.
struct StepInputs {
  DensifierOptions options;         ///< as given; sizes may be 0
  int width = 0;                    ///< of the depth maps [px]
  std::string options_json;         ///< without those of the machine
  std::string planes_options_json;  ///< of these, those that affect planes
  std::string engine;               ///< program and kind of processor; equal texts mean equal bytes
  std::string mask;                 ///< fingerprint; "" = none
  std::vector<StepKeyframe> keyframes;
  bool recompute_points = false;  ///< make all points from scratch, since depth maps are also requested
  bool growing = false;           ///< more keyframes will follow: the newest ones get fewer passes for now
};

/// Work of a step on a keyframe with a depth map, with its reason.
struct StepKeyframePlan {
  KeyframePose pose;               ///< with the scale of the existing planes
  bool has_planes = false;         ///< recorded ones are reused
  int passes = 0;                  ///< of PatchMatch; 0 = the planes are kept
  bool photometric_first = false;  ///< see PlaneReuse
  std::string reason;              ///< of matching; "" = planes are kept
  std::string own;                 ///< see RecordedPlanes
  std::string planes_file;         ///< after the step
  bool points_kept = false;
  std::string points_inputs;                  ///< see RecordedPoints
  std::vector<std::int64_t> required_planes;  ///< keyframes whose planes affect the points
  std::string points_file;
};

/// Step of a workspace: the work that leads from the record to the current mission.
struct PMSP_API Step {
  std::string name;  ///< 16 hexadecimal digits; a function of record and inputs
  Plan plan;
  std::map<std::int64_t, StepKeyframePlan> keyframes;         ///< those with a depth map
  std::map<std::int64_t, std::vector<RecordedRange>> ranges;  ///< of all keyframes, see RecordedKeyframe

  /// Number of keyframes that lack passes after the step.
  int unfinished = 0;

  /// Returns the planes that the run reuses, without results of an interrupted run of the step.
  std::map<std::int64_t, PlaneReuse> reuses(int passes) const;
};

/// Displacement relative to source views above which planes are refined [px of the depth map].
constexpr double kKeptMove = 0.15;
/// ... of the newest keyframes of a growing mission, above which they are matched again [px].
constexpr double kUnstableMove = 1.0;
/// ... above which a keyframe is matched from scratch [px].
constexpr double kMovedMove = 3.0;
/// Displacement relative to keyframes that points depend on, above which these are made again [px].
constexpr double kPointsMove = 0.1;

/// Returns the name of the step from this record with these inputs. Sharpness is ignored, since it follows from the
/// rest.
PMSP_API std::string step_name(const Record& record, const StepInputs& inputs);

/// Returns the name of the file for the planes that the step makes of a keyframe.
PMSP_API std::string planes_name(std::int64_t keyframe_id, const std::string& step);

/// Returns the fingerprint of the inputs of planes without poses and source views: see RecordedPlanes::own. `image`:
/// see StepKeyframe.
PMSP_API std::string planes_inputs(const StepInputs& inputs, const std::string& image);

/// Plans a step: a pure function. Planes are kept if image, mask, options and engine are equal and the keyframe has
/// hardly moved relative to its source views; refined after small moves or with other source views; else made from
/// scratch. Changes of scale by loop closures of a monocular SLAM are estimated (recover_scales) and compensated first.
/// Points are kept if all their inputs are equal and have hardly moved.
PMSP_API Step plan_step(const Record& record, const StepInputs& inputs);

/// Returns the record of an unfinished step: its images and planes, which may lack files.
PMSP_API Record record_of_begun(const std::string& step, const StepInputs& inputs);

/// Returns the record after the step. `record`: the previous one.
PMSP_API Record record_of(const Step& step, const StepInputs& inputs, const Record& record);

}  // namespace pmsp::workspace
