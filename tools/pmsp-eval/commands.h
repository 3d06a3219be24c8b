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

/// What all commands need.
struct CommonArguments {
  std::filesystem::path truth;       ///< folder
  std::filesystem::path map;         ///< one of map and trajectory is set
  std::filesystem::path trajectory;  ///< TUM
  AlignmentOptions alignment;
  double truth_fps = 10.0;
  int threads = 0;
  std::string json;  ///< path, "-" for standard output, empty for none
};

struct RenderArguments {
  std::filesystem::path folder;  ///< empty = no pictures
  int keyframes = 4;             ///< 0 = all
};

struct CloudArguments {
  std::filesystem::path cloud;
  bool as_is = false;  ///< the cloud is in the frame of the keyframes, whatever its header says
  SurfaceOptions surface;
  CloudMeasureOptions measures;
  ViewOptions views;
  RenderArguments render;
};

struct DepthArguments {
  std::vector<std::filesystem::path> inputs;
  std::optional<std::int64_t> keyframe;
  double png_scale = 0.0;  ///< 0 = not given
  DepthMeasureOptions measures;
  LabelOptions labels;
  RenderArguments render;
  bool own_scales = false;            ///< each map's scale by itself, see own_scale
  std::filesystem::path calibration;  ///< plot; empty = none
};

struct AlignArguments {
  std::filesystem::path write_trajectory;  ///< empty = none
  bool aligned = false;                    ///< write it in the frame of the truth instead of the map's
};

/// Each measures, prints the table and writes JSON. Throws pmsp::Error.
void run_cloud(const CommonArguments& common, CloudArguments arguments);
void run_depth(const CommonArguments& common, DepthArguments arguments);
void run_align(const CommonArguments& common, const AlignArguments& arguments);

}  // namespace pmsp::eval
