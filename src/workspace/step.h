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

/// A keyframe of the mission as it is now.
struct StepKeyframe {
  PlanKeyframe keyframe;
  std::string image;          ///< fingerprint
  int width = 0, height = 0;  ///< of the image [px]
  std::string looked_for;     ///< options that the sharpness was recorded with
};

/// All that the results of a step are made from, besides the workspace itself.
struct StepInputs {
  DensifierOptions options;         ///< as told; sizes may be 0
  int width = 0;                    ///< of the depth maps [px]
  std::string options_json;         ///< of all that is no matter of the machine
  std::string planes_options_json;  ///< of these, those that planes depend on
  std::string engine;               ///< program and kind of processor: what makes the same bytes has the same text
  std::string mask;                 ///< fingerprint; "" = there is none
  std::vector<StepKeyframe> keyframes;
  bool ask_all_again = false;  ///< make all points anew, since depth maps are wanted, too
  bool growing = false;        ///< more keyframes will come: the newest ones make do with fewer passes for now
};

/// What a step does for a keyframe with a depth map, and why.
struct StepKeyframePlan {
  KeyframePose pose;          ///< the scale is that of what it has
  bool has_planes = false;    ///< recorded ones that help
  int passes = 0;             ///< of PatchMatch; 0 = the planes are kept
  bool images_first = false;  ///< see Shortcut
  std::string reason;         ///< why it is matched; "" where planes are kept
  std::string own;            ///< see RecordedPlanes
  std::string planes_file;    ///< when the step is through
  bool points_kept = false;
  std::string points_inputs;        ///< see RecordedPoints
  std::vector<std::int64_t> asked;  ///< keyframes whose planes are behind them
  std::string points_file;
};

/// A step of a workspace: what has to be done to come from what is recorded to the mission as it is now.
struct PMSP_API Step {
  std::string name;  ///< of 16 hexadecimal digits; a function of the record and the inputs
  Plan plan;
  std::map<std::int64_t, StepKeyframePlan> keyframes;         ///< those with a depth map
  std::map<std::int64_t, std::vector<RecordedRange>> ranges;  ///< of all keyframes, see RecordedKeyframe

  /// Keyframes that lack passes when it is through.
  int unfinished = 0;

  /// As a run takes it, but for what an interrupted run of the step has left.
  std::map<std::int64_t, Shortcut> shortcuts(int passes) const;
};

/// Poses relative to neighbours may have moved what is seen by so much before planes are refined [px of the depth map].
constexpr double kKeptMove = 0.15;
/// While a mission grows, its newest keyframes wait with moves up to this until they are matched anew [px].
constexpr double kUnstableMove = 1.0;
/// And by so much before a keyframe is matched from the beginning [px].
constexpr double kMovedMove = 3.0;
/// And relative to keyframes that its points depend on before these are asked again [px].
constexpr double kPointsMove = 0.1;

/// The name of the step from this record with these inputs. How sharp images are has no say in it: that follows from
/// the rest.
PMSP_API std::string step_name(const Record& record, const StepInputs& inputs);

/// Of the file with the planes of a keyframe that the step makes.
PMSP_API std::string planes_name(std::int64_t keyframe_id, const std::string& step);

/// Fingerprint of what planes are made from, besides poses and neighbours: see RecordedPlanes::own. `image`: see
/// StepKeyframe.
PMSP_API std::string planes_inputs(const StepInputs& inputs, const std::string& image);

/// Decides a step: a pure function. Planes are kept where image, mask, options and engine are the same and the
/// keyframe has hardly moved relative to those that it was matched with; refined where it has been given other
/// neighbours, or has moved a little; made anew else. Scales that a monocular SLAM's loop closure has changed are found
/// again (recover_scales) and taken off before. Points are kept where all that they were made from is, and has hardly
/// moved.
PMSP_API Step plan_step(const Record& record, const StepInputs& inputs);

/// What a step of this name will have made: images and planes, those of which there are files.
PMSP_API Record record_of_begun(const std::string& step, const StepInputs& inputs);

/// What is recorded when the step is through. `record`: that of before.
PMSP_API Record record_of(const Step& step, const StepInputs& inputs, const Record& record);

}  // namespace pmsp::workspace
