// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "pmsp/stages.h"
#include "workload.h"

namespace pmsp::bench {

/// Timed stage. `run`: loop of Google Benchmark; one iteration is the work of one keyframe.
struct Stage {
  const char* name;
  const char* what;
  bool needs_maps;  ///< needs depth maps in the workload, on the CPU
  bool on_device;   ///< also timed by run_on_device
  void (*run)(benchmark::State& state, const Workload& workload,
              const Executor& executor);  ///< nullptr: not on the CPU
};

/// In pipeline order.
const std::vector<Stage>& all_stages();

/// Throws InvalidOption.
const Stage& stage_named(const std::string& name);

/// Whole keyframes measure latency and take long: with the largest number of threads only.
inline bool is_end_to_end(const Stage& stage) {
  const std::string name = stage.name;
  return name == "keyframe" || name == "cloud";
}

}  // namespace pmsp::bench
