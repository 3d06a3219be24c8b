// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "pmsp-eval/alignment.h"
#include "pmsp-eval/calibration.h"
#include "pmsp-eval/cloud_measures.h"
#include "pmsp-eval/depth_measures.h"
#include "pmsp-eval/view_measures.h"

namespace pmsp::eval {

using Json = nlohmann::ordered_json;

/// A depth map's measures with its keyframe.
struct KeyframeDepth {
  std::int64_t keyframe_id = 0;
  int width = 0;
  int height = 0;
  DepthMeasures measures;
};

/// Shares are numbers from 0 to 1; lengths are metres; a figure that does not exist is null.
Json to_json(const Alignment& alignment);
Json to_json(const CloudMeasures& measures);
Json to_json(const ViewMeasures& measures);
Json to_json(const DepthMeasures& measures);
Json to_json(const std::vector<KeyframeDepth>& maps);
Json to_json(const Calibration& calibration);

/// The same for people, lines of at most 100 characters.
std::string to_table(const Alignment& alignment);
std::string to_table(const CloudMeasures& measures);
std::string to_table(const ViewMeasures& measures, const ViewOptions& options);
std::string to_table(const std::vector<KeyframeDepth>& maps);
std::string to_table(const Calibration& calibration);

}  // namespace pmsp::eval
