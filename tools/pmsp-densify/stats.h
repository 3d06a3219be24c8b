// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "calibration.h"
#include "io/pairing.h"
#include "mask_report.h"
#include "pmsp/densifier.h"
#include "pmsp/io/images.h"
#include "time_account.h"

namespace pmsp::tool {

/// What a run did, for stats.json and for the summary.
struct RunReport {
  DensifierOptions options;  ///< in force
  DensifierStats stats;
  std::string map;
  std::string images;                ///< how they were matched
  std::vector<std::string> outputs;  ///< files and folders
  nlohmann::ordered_json cloud;      ///< its frame and amount, see cloud_json
  std::int64_t points_written = 0;
  double confidence = 0.0;    ///< mean of the points
  std::size_t keyframes = 0;  ///< in the map
  std::size_t with_image = 0;
  std::vector<SkippedKeyframe> skipped;
  std::vector<std::string> warnings;  ///< see Progress::warning
  std::optional<PairingVerifier::Verdict> pairing;
  MaskReport masks;
  Calibration calibration;
  TimeAccount time;                    ///< of the main thread
  std::optional<double> device_start;  ///< what starting a CUDA device took, beside all else [s]; none without one
  std::string empty_reason;            ///< of an empty result
  nlohmann::ordered_json prior_depth;  ///< of each keyframe that was looked at; null without
  nlohmann::ordered_json given_depth;  ///< of fuse; null else
  nlohmann::ordered_json workspace;    ///< what was kept and what was made; null without one
};

/// Times up to now.
nlohmann::ordered_json to_json(const RunReport& report);

/// Counts of each stage and times up to now, a few lines for people.
std::string summary(const RunReport& report);

/// Which stage lost the points, and the option to try.
std::string explain_empty(const DensifierStats& stats);

/// Warning that the consistency filter keeps less than a fifth of the pixels that reach it; "" = it keeps more, or
/// none.
std::string consistency_warning(const DensifierStats& stats);

/// Largest resident memory of this process so far [MiB].
double peak_memory_mib();

}  // namespace pmsp::tool
