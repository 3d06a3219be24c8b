// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "plan/plan.h"
#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp::workspace {

/// A keyframe that another one was matched with, and where it was then.
struct RecordedSource {
  std::int64_t id = 0;
  std::string image;
  KeyframePose pose;
};

/// A keyframe's planes and what they were made from.
struct RecordedPlanes {
  std::string file;                     ///< in the folder "planes"; its name ends with the step that made it
  std::string own;                      ///< fingerprint of its image, the mask, options and engine
  int passes = 0;                       ///< of PatchMatch, since it was matched from the beginning
  KeyframePose pose;                    ///< when it was matched last
  std::vector<RecordedSource> sources;  ///< near and far then, in the order of the plan
};

/// A keyframe's points and what they were made from.
struct RecordedPoints {
  std::string file;    ///< in the folder "points"
  std::string inputs;  ///< fingerprint of all planes, lists of the plan and options behind them
  std::string step;    ///< whose poses they were made with
};

/// How far a landmark was from a keyframe [the map's unit].
struct RecordedRange {
  std::int64_t landmark = 0;
  double range = 0.0;
};

/// What is recorded of a keyframe.
struct RecordedKeyframe {
  std::string image;
  int width = 0, height = 0;  ///< of the image [px]
  std::string looked_for;     ///< options that the sharpness was recorded with
  SharpnessRecord sharpness;
  KeyframePose pose;
  std::vector<RecordedRange> ranges;  ///< of some landmarks, from the pose; ascending ids
  std::optional<RecordedPlanes> planes;
  std::optional<RecordedPoints> points;
};

/// Metadata of the cloud, so that it can be written again without the map.
struct RecordedCloud {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< see CloudHeader; in the frame of the map
  double reach = 0.0;                                ///< [the map's unit]; 0 = not recorded
  std::vector<std::string> comments;                 ///< how it was made, but for its frame
};

/// Key of the rig mask among the options of a record.
constexpr const char* kRigMask = "rig_mask";

/// What a workspace holds after its last finished step, and where all of it came from.
struct Record {
  std::string step;
  std::string engine;
  std::string options = "{}";
  std::size_t lenses_looked_at = 0;  ///< keyframes with an image when the lenses' distance was last estimated
  std::string map, images;           ///< as told by the step, for people
  std::vector<std::string> outputs;  ///< paths, relative to the workspace where possible, that runs have written
  RecordedCloud cloud;
  Plan plan;
  std::map<std::int64_t, RecordedKeyframe> keyframes;
  std::map<std::string, std::map<std::int64_t, KeyframePose>> poses;  ///< by step, of those that points were made from
};

PMSP_API std::string record_json(const Record& record);
/// `where` names the source in messages. Throws InvalidInput.
PMSP_API Record record_from_json(const std::string& text, const std::string& where);

}  // namespace pmsp::workspace
