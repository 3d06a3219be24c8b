// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cpu_pace.h"
#include "plan/plan.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/options.h"

namespace pmsp::tool {

/// Memory of the host that a run is expected to take at the most [bytes].
struct MemoryBudget {
  double scratch = 0.0;   ///< on disk: on the CPU, and on a GPU on which not all finds room
  double host = 0.0;      ///< on the CPU
  double gpu_host = 0.0;  ///< the host's, with a GPU
};

/// Memory of a GPU that it is expected to take at the most [bytes].
struct DeviceBudget {
  double all = 0.0;
  double least = 0.0;  ///< where what waits lies in the scratch folder
};

/// With images of this width. A run, which does not know it, asks for as much as with kAnyImageWidth (pmsp/cost.h).
DeviceBudget estimate_device(DensifierOptions options, std::int64_t used, int image_width);

/// What is expected of a run with so many keyframes. `options`: with sizes. The same without a plan.
MemoryBudget estimate_memory(const SlamMap& map, DensifierOptions options, std::int64_t used, int image_width,
                             int image_height);

/// What a run is expected to take. Bytes are bytes.
struct Budget {
  int width = 0;  ///< of the depth maps
  int height = 0;
  std::int64_t keyframes = 0;   ///< that have an image
  std::int64_t used = 0;        ///< of them
  std::int64_t depth_maps = 0;  ///< of the used ones
  double views = 0.0;           ///< that a depth map is matched with, on average
  double points_per_pixel = 0.0;
  double points = 0.0;
  double cloud_bytes = 0.0;
  double workspace_bytes = 0.0;  ///< where one is kept
  MemoryBudget memory;
  DeviceBudget device;
  double cpu_seconds = 0.0;        ///< of all threads together
  double reference_seconds = 0.0;  ///< on the GPU that figures are known of
  int threads = 1;                 ///< that the CPU backend would use
};

/// What is asked about.
struct BudgetQuestion {
  const SlamMap& map;
  const Plan& plan;          ///< of the keyframes that have an image
  DensifierOptions options;  ///< sizes may be 0
  int image_width = 0;       ///< 0 = the map's camera's
  int image_height = 0;
  CpuPace pace;
};

Budget estimate_budget(const BudgetQuestion& question);

/// Keyframes for a plan, without a look at images: all of the map, or those with an image in `source`; each counts as
/// sharp. `source`: nullptr = all.
std::vector<PlanKeyframe> keyframes_without_image(const SlamMap& map, const ImageSource* source,
                                                  const DensifierOptions& options);

/// The GPU of `Budget::reference_seconds`, in words.
extern const char* const kReferenceGpu;

}  // namespace pmsp::tool
