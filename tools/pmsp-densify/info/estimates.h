// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "cpu_pace.h"
#include "plan/plan.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/options.h"

namespace pmsp::tool {

struct Arguments;

// Sizes of results [bytes].
constexpr double kPlanesBytes = 16.0;  ///< planes of a workspace, per pixel
constexpr double kPointBytes = 40.0;   ///< points of a workspace, each
constexpr double kPlyBytes = 32.0;     ///< points of a PLY file, each

/// Expected peak host memory of a run [bytes].
struct MemoryBudget {
  double scratch = 0.0;   ///< on disk: on the CPU, or on a GPU without enough memory
  double host = 0.0;      ///< on the CPU
  double gpu_host = 0.0;  ///< with a GPU
};

/// Expected peak memory of a GPU [bytes].
struct DeviceBudget {
  double all = 0.0;
  double least = 0.0;  ///< with pending data in the scratch folder
};

/// For images of this width. A run, which does not know it in advance, requires as much as with kAnyImageWidth
/// (engine).
DeviceBudget estimate_device(DensifierOptions options, std::int64_t used, int image_width);

/// Estimates memory of a run with `used` keyframes, without a plan. `options`: with sizes.
MemoryBudget estimate_memory(const SlamMap& map, DensifierOptions options, std::int64_t used, int image_width,
                             int image_height);

/// Returns the expected memory of outputs besides clouds [bytes]: maps for robots, and depth images of datasets. Throws
/// IoError, InvalidInput if the frame of the cloud cannot be found. `options`: with sizes.
double memory_of_outputs(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                         const ImageSource& images);

/// Expected cost of a run.
struct Budget {
  int width = 0;  ///< of the depth maps
  int height = 0;
  std::int64_t keyframes = 0;   ///< with an image
  std::int64_t used = 0;        ///< used keyframes
  std::int64_t depth_maps = 0;  ///< used keyframes with a depth map
  double views = 0.0;           ///< mean number of source views
  double points_per_pixel = 0.0;
  double points = 0.0;
  double cloud_bytes = 0.0;
  double workspace_bytes = 0.0;  ///< with a workspace
  MemoryBudget memory;
  DeviceBudget device;
  double cpu_seconds = 0.0;        ///< of all threads together
  double reference_seconds = 0.0;  ///< on kReferenceGpu
  int threads = 1;                 ///< of the CPU backend
};

/// Input of an estimate.
struct BudgetQuestion {
  const SlamMap& map;
  const Plan& plan;          ///< of the keyframes with an image
  DensifierOptions options;  ///< sizes may be 0
  int image_width = 0;       ///< 0 = that of the map's camera
  int image_height = 0;
  CpuPace pace;
};

Budget estimate_budget(const BudgetQuestion& question);

/// Returns keyframes for a plan without reading images, which count as sharp: those with an image in `source`; nullptr
/// = all of the map.
std::vector<PlanKeyframe> keyframes_without_image(const SlamMap& map, const ImageSource* source,
                                                  const DensifierOptions& options);

/// GPU of `Budget::reference_seconds`.
extern const char* const kReferenceGpu;

nlohmann::ordered_json to_json(const Budget& budget);

/// Returns "12 MiB", "1.5 GiB".
std::string bytes_text(double bytes);

/// Formats a budget as a few lines for people.
std::string budget_text(const Budget& budget);

/// Returns a line with the expected CPU time of a run, and with --quality online; "" for runs below half a minute.
/// `options`: of the run, `online`: of the alternative. Takes up to two seconds.
std::string cpu_time_text(const SlamMap& map, const ImageSource& source, const DensifierOptions& options,
                          const DensifierOptions& online);

}  // namespace pmsp::tool
