// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "calibration.h"
#include "io/pairing.h"
#include "mission_input.h"
#include "pmsp/densifier.h"
#include "pmsp/io/images.h"
#include "progress.h"

namespace pmsp::tool {

/// Results of a run for stats.json and summary.
struct RunReport {
  DensifierOptions options;  ///< effective
  DensifierStats stats;
  std::string map;
  std::string images;                ///< description of their pairing
  std::vector<std::string> outputs;  ///< paths
  nlohmann::ordered_json cloud;      ///< frame and size, see cloud_json
  std::int64_t points_written = 0;
  double confidence = 0.0;    ///< mean over the points
  std::size_t keyframes = 0;  ///< in the map
  std::size_t with_image = 0;
  std::vector<SkippedKeyframe> skipped;
  std::vector<std::string> warnings;  ///< see Progress::warning
  std::optional<PairingVerifier::Verdict> pairing;
  MaskReport masks;
  Calibration calibration;
  TimeAccount time;                        ///< of the main thread
  std::optional<double> device_start;      ///< time to start a CUDA device, concurrent [s]; nullopt = none
  std::string empty_reason;                ///< of an empty result
  nlohmann::ordered_json prior_depth;      ///< per keyframe; null = not used
  nlohmann::ordered_json external_depths;  ///< of fuse, else null
  nlohmann::ordered_json workspace;        ///< kept and new parts; null = none
};

/// Includes times up to now.
nlohmann::ordered_json to_json(const RunReport& report);

/// Returns counts of each stage and times up to now, a few lines for people.
std::string summary(const RunReport& report);

/// Returns which stage lost the points, and an option to try.
std::string explain_empty(const DensifierStats& stats);

/// Returns a warning if the consistency filter keeps less than a fifth of its input pixels; "" if it keeps more, or
/// none.
std::string consistency_warning(const DensifierStats& stats);

}  // namespace pmsp::tool
