// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "bench_report.h"
#include "workload.h"

namespace pmsp::bench {

/// What is measured on a CUDA device, with flights that run to and fro over the workload's keyframes.
struct DeviceRequest {
  int device = 0;
  std::vector<std::string> stages;
  int keyframes = 30;  ///< of one flight
  int repetitions = 5;
};

/// Adds the times per keyframe of each stage, by the device's own clock, and of whole keyframes, by the wall clock; one
/// figure for each flight. A first flight of each kind is not counted: it allocates. Throws as Densifier does.
void run_on_device(const Workload& workload, const DeviceRequest& request, Results& results, DeviceFigures& figures);

}  // namespace pmsp::bench
