// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/options.h"

namespace pmsp::bench {

constexpr int kRepetitions = 3;
constexpr int kDeviceRepetitions = 5;

struct Arguments {
  std::vector<std::string> qualities = {"online"};
  int width = 0;                                                             ///< of the depth maps; 0 = of the preset
  int height = 0;                                                            ///< of the depth maps; 0 = half the width
  std::optional<int> neighbours, iterations, refinements, geometric_passes;  ///< instead of those of the preset
  int image_width = 0;                ///< of the keyframes; 0 = 1920, or the width of the depth maps if larger
  std::filesystem::path map, images;  ///< given input; empty = rendered
  std::vector<std::string> stages;
  bool cpu = true;
  bool cuda = false;  ///< a device is available, or cuda was requested
  int device = 0;
  int keyframes = 30;              ///< of a sequence on the device
  std::vector<Simd> simds;         ///< scalar first
  std::vector<int> threads;        ///< ascending
  std::optional<int> repetitions;  ///< empty: kRepetitions, fewer for the slowest; kDeviceRepetitions
  bool list = false;
  std::filesystem::path json;            ///< empty = none
  std::vector<std::string> google_args;  ///< --benchmark_*, for Google Benchmark
};

/// Returns nullopt for help and version. Throws tool::UsageError, InvalidOption and BackendUnavailable.
std::optional<Arguments> parse_arguments(int argc, char** argv);

}  // namespace pmsp::bench
