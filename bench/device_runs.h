// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "bench_report.h"
#include "workload.h"

namespace pmsp::bench {

/// Measurements on a CUDA device, with sequences to and fro over the workload's keyframes.
struct DeviceRequest {
  int device = 0;
  std::vector<std::string> stages;
  int keyframes = 30;  ///< of a sequence
  int repetitions = 5;
};

/// Adds times per keyframe: of each stage by the device's clock, of whole keyframes by the wall clock; one value per
/// sequence. The first sequence of each kind, which allocates, is not counted. Throws as Densifier.
void run_on_device(const Workload& workload, const DeviceRequest& request, Results& results, DeviceFigures& figures);

}  // namespace pmsp::bench
