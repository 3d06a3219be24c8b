// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pmsp-eval/alignment.h"
#include "pmsp-eval/cloud_measures.h"
#include "pmsp-eval/depth_measures.h"
#include "pmsp-eval/label_measures.h"
#include "pmsp-eval/surface.h"
#include "pmsp-eval/view_measures.h"

namespace pmsp::eval {

/// Common arguments of all commands.
struct CommonArguments {
  std::filesystem::path truth;       ///< folder
  std::filesystem::path map;         ///< either map or trajectory is set
  std::filesystem::path trajectory;  ///< TUM
  AlignmentOptions alignment;
  bool map_is_truth = false;  ///< the poses of the keyframes are the truth; range maps are named by keyframe id
  double truth_fps = 10.0;
  double truth_png_scale = 0.0;  ///< of range/<frame>.png [m]; 0 = not set
  int threads = 0;
  std::string json;  ///< path; "-" = standard output, "" = none
};

struct RenderArguments {
  std::filesystem::path folder;  ///< empty = no pictures
  int keyframes = 4;             ///< 0 = all
};

struct CloudArguments {
  std::filesystem::path cloud;
  bool as_is = false;  ///< the cloud is in the frame of the keyframes, regardless of its header
  SurfaceOptions surface;
  CloudMeasureOptions measures;
  ViewOptions views;
  RenderArguments render;
};

struct DepthArguments {
  std::vector<std::filesystem::path> inputs;
  std::optional<std::int64_t> keyframe;
  double png_scale = 0.0;  ///< 0 = not set
  DepthMeasureOptions measures;
  LabelOptions labels;
  RenderArguments render;
  bool own_scales = false;            ///< scales each map separately, see own_scale
  double max_true_range_m = 0.0;      ///< farther pixels do not count; 0 = all
  std::filesystem::path calibration;  ///< plot; empty = none
};

struct AlignArguments {
  std::filesystem::path write_trajectory;  ///< empty = none
  bool aligned = false;                    ///< in the frame of the truth instead of the map's
};

/// Each measures, prints a table and writes JSON. Throws pmsp::Error.
void run_cloud(const CommonArguments& common, CloudArguments arguments);
void run_depth(const CommonArguments& common, DepthArguments arguments);
void run_align(const CommonArguments& common, const AlignArguments& arguments);

}  // namespace pmsp::eval
