// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "pmsp/stages.h"
#include "workload.h"

namespace pmsp::bench {

/// Something that is timed. `run` is Google Benchmark's loop; one iteration of it is one keyframe's share.
struct Stage {
  const char* name;
  const char* what;
  bool needs_maps;  ///< of its workload, on the CPU
  bool on_device;   ///< run_on_device times it too
  void (*run)(benchmark::State& state, const Workload& workload,
              const Executor& executor);  ///< nullptr: not on the CPU
};

/// In the order of the pipeline.
const std::vector<Stage>& all_stages();

/// Throws InvalidOption.
const Stage& stage_named(const std::string& name);

/// Whole keyframes are about latency and run for long: with the largest number of threads only.
inline bool is_end_to_end(const Stage& stage) {
  const std::string name = stage.name;
  return name == "keyframe" || name == "cloud";
}

}  // namespace pmsp::bench
