// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "pmsp-bench/workload.h"
#include "pmsp/executor.h"

namespace pmsp::bench {

/// Something that is timed. `run` is Google Benchmark's loop; one iteration of it is one keyframe's share.
struct Stage {
  const char* name;
  const char* what;
  bool needs_maps;  ///< of its workload
  void (*run)(benchmark::State& state, const Workload& workload, const Executor& executor);
};

/// In the order of the pipeline.
const std::vector<Stage>& all_stages();

/// Throws InvalidOption.
const Stage& stage_named(const std::string& name);

/// `keyframe` is about latency and runs for long: with the largest number of threads only.
inline bool is_end_to_end(const Stage& stage) { return std::string(stage.name) == "keyframe"; }

}  // namespace pmsp::bench
