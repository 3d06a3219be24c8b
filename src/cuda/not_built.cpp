// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/cuda_engine.h"
#include "pmsp/error.h"

// Replaces the other files of this folder in builds without CUDA.
namespace pmsp::cuda {

Device find_device(int /*number*/) {
  Device device;
  device.why_not = "this build has none; build with a CUDA toolkit and -DPMSP_CUDA=ON";
  return device;
}

int device_count() { return 0; }

void enable_peer_access(const std::vector<int>& /*devices*/) {}

void close(const std::vector<int>& /*devices*/) noexcept {}

std::unique_ptr<Engine> make_engine(const EngineContext& /*context*/, Executor /*executor*/) {
  throw BackendUnavailable(find_device(0).why_not);
}

}  // namespace pmsp::cuda
