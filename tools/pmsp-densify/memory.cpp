// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <limits>
#include <numeric>
#include <vector>

#include <nlohmann/json.hpp>

#include "budget.h"
#include "cost.h"
#include "devices.h"
#include "image_input.h"
#include "io/convention.h"
#include "map_input.h"
#include "verbs.h"

namespace pmsp::tool {
namespace {

// Additional memory of a run with a workspace.
constexpr double kWorkspaceKeyframe = 60e3;  // per keyframe
constexpr double kWorkspacePixel = 16 + 40;  // per pixel of depth maps: planes and points in flight to their files
constexpr double kWorkspaceGpu = 128.0 * 1024 * 1024;  // data in flight, if produced faster than written

/// CUDA devices of the run.
std::vector<int> devices_of(const DensifierOptions& options) {
  if (options.backend == Backend::kCpu) return {};
  if (!options.devices.empty()) return options.devices;
  std::vector<int> all(static_cast<std::size_t>(std::max(1, device_count())));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// Minimum over the devices; 0 = one is unusable, or there is none.
std::size_t free_on(const std::vector<int>& devices) {
  std::size_t least = devices.empty() ? 0 : std::numeric_limits<std::size_t>::max();
  for (const int device : devices) least = std::min(least, free_device_memory(device));
  return least;
}

std::int64_t whole(double bytes) { return static_cast<std::int64_t>(std::llround(bytes)); }

}  // namespace

void print_memory(const Arguments& arguments) {
  DensifierOptions options = effective_options(arguments);
  const SlamMap map = read_map(arguments);
  if (!arguments.no_verify) require_convention(map);
  const std::unique_ptr<ImageSource> source = open_images(arguments, map);
  const std::int64_t keyframes = static_cast<std::int64_t>(source->keyframe_ids().size());
  ImageSize size = first_size(*source);
  if (size.width == 0 && !map.cameras.empty()) size = {map.cameras[0].width, map.cameras[0].height};
  fill_in_size(options, size.width, size.height);
  const MemoryBudget memory = estimate_memory(map, options, keyframes, size.width, size.height);
  const DeviceBudget asked = estimate_device(options, keyframes, kAnyImageWidth);
  const double pixels = static_cast<double>(options.width) * static_cast<double>(options.height);
  const double workspace = arguments.workspace.empty()
                               ? 0.0
                               : kWorkspaceKeyframe * static_cast<double>(keyframes) + kWorkspacePixel * pixels;
  const double gpu_workspace = arguments.workspace.empty() ? 0.0 : kWorkspaceGpu;
  const std::vector<int> devices = devices_of(options);
  const nlohmann::ordered_json json{{"cpu", {{"memory_bytes", whole(memory.host + workspace)}}},
                                    {"gpu",
                                     {{"memory_bytes", whole(memory.gpu_host + workspace + gpu_workspace)},
                                      {"device_bytes", whole(asked.all)},
                                      {"least_device_bytes", whole(asked.least)},
                                      {"devices", devices},
                                      {"free_device_bytes", free_on(devices)}}}};
  std::cout << json.dump(2) << "\n";
}

}  // namespace pmsp::tool
