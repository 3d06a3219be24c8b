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

/// Source view of a keyframe, with its pose at that time.
struct RecordedSource {
  std::int64_t id = 0;
  std::string image;
  KeyframePose pose;
};

/// Planes of a keyframe and their inputs.
struct RecordedPlanes {
  std::string file;                     ///< in folder "planes"; ends with the step that made it
  std::string own;                      ///< fingerprint of its image, the mask, options and engine
  int passes = 0;                       ///< passes of PatchMatch since matching from scratch
  KeyframePose pose;                    ///< at the last match
  std::vector<RecordedSource> sources;  ///< at the last match, in the order of the plan
};

/// Points of a keyframe and their inputs.
struct RecordedPoints {
  std::string file;    ///< in folder "points"
  std::string inputs;  ///< fingerprint of the planes, lists of the plan and options that determine them
  std::string step;    ///< step of the poses that they were made with
};

/// Distance of a landmark from a keyframe [map units].
struct RecordedRange {
  std::int64_t landmark = 0;
  double range = 0.0;
};

/// Record of a keyframe.
struct RecordedKeyframe {
  std::string image;
  int width = 0, height = 0;  ///< of the image [px]
  std::string looked_for;     ///< options of the sharpness
  SharpnessRecord sharpness;
  KeyframePose pose;
  std::vector<RecordedRange> ranges;  ///< of some landmarks, from `pose`; ascending ids
  std::optional<RecordedPlanes> planes;
  std::optional<RecordedPoints> points;
};

/// Metadata of the cloud, for writing it without the map.
struct RecordedCloud {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< see CloudHeader; map frame
  double reach = 0.0;                                ///< [map units]; 0 = not recorded
  std::vector<std::string> comments;                 ///< processing, without the frame
};

/// Key of the rig mask in the options of a record.
constexpr const char* kRigMask = "rig_mask";

/// Content of a workspace after its last completed step, with the inputs.
struct Record {
  std::string step;
  std::string engine;
  std::string options = "{}";
  std::size_t lenses_looked_at = 0;  ///< keyframes with an image at the last estimation of the lens distance
  std::string map, images;           ///< as given to the step, for messages
  std::vector<std::string> outputs;  ///< files written by runs, relative to the workspace where possible
  RecordedCloud cloud;
  Plan plan;
  std::map<std::int64_t, RecordedKeyframe> keyframes;
  std::map<std::string, std::map<std::int64_t, KeyframePose>> poses;  ///< by step, for the points made with them
};

PMSP_API std::string record_json(const Record& record);
/// `where`: source, for messages. Throws InvalidInput.
PMSP_API Record record_from_json(const std::string& text, const std::string& where);

}  // namespace pmsp::workspace
