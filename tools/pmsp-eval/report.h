// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "pmsp-eval/alignment.h"
#include "pmsp-eval/calibration.h"
#include "pmsp-eval/cloud_measures.h"
#include "pmsp-eval/depth_measures.h"
#include "pmsp-eval/label_measures.h"
#include "pmsp-eval/view_measures.h"

namespace pmsp::eval {

using Json = nlohmann::ordered_json;

/// Measures of a keyframe's depth map.
struct KeyframeDepth {
  std::int64_t keyframe_id = 0;
  int width = 0;
  int height = 0;
  DepthMeasures measures;
  LabelTable labels;
};

/// Numbers of points by label, see count_behind and count_floating.
struct LabelCounts {
  std::size_t points = 0;  ///< of the cloud
  std::map<int, std::size_t> counts;
};

/// Shares are 0 to 1, lengths in metres, undefined values null.
Json to_json(const Alignment& alignment);
Json to_json(const CloudMeasures& measures);
Json to_json(const ViewMeasures& measures);
Json to_json(const DepthMeasures& measures);
Json to_json(const std::vector<KeyframeDepth>& maps);
Json to_json(const Calibration& calibration);
Json to_json(const LabelTable& labels);
Json to_json(const LabelCounts& counts);

/// The same for people, in lines of at most 100 characters.
std::string to_table(const Alignment& alignment);
std::string to_table(const CloudMeasures& measures);
std::string to_table(const ViewMeasures& measures, const ViewOptions& options);
/// `scaling`: how depth maps were scaled.
std::string to_table(const std::vector<KeyframeDepth>& maps, const std::string& scaling, const LabelOptions& options);
std::string to_table(const Calibration& calibration);
std::string to_table(const LabelTable& labels, const LabelOptions& options);
std::string table_of_behind(const LabelCounts& counts, const LabelOptions& options);
std::string table_of_floating(const LabelCounts& counts);  ///< "" without floating points

}  // namespace pmsp::eval
