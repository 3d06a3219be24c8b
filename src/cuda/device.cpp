// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>

#include "cuda/cuda_engine.h"
#include "cuda/launch.h"
#include "cuda/memory.h"
#include "pmsp/error.h"

namespace pmsp::cuda {

int device_count() {
  int count = 0;
  if (cudaGetDeviceCount(&count) == cudaSuccess) return count;
  cudaGetLastError();  // clears the error
  return 0;
}

void enable_peer_access(const std::vector<int>& devices) {
  for (const int from : devices) {
    for (const int to : devices) {
      int can = 0;
      if (from == to || cudaDeviceCanAccessPeer(&can, from, to) != cudaSuccess || can == 0) continue;
      const DeviceScope scope(from);
      cudaDeviceEnablePeerAccess(to, 0);
    }
  }
  cudaGetLastError();  // that they are connected already is no error; without a connection copies are slower
}

void close(const std::vector<int>& devices) noexcept {
  for (auto device = devices.begin(); device != devices.end(); ++device) {
    const bool is_closed = std::find(devices.begin(), device, *device) != device;
    if (!is_closed && cudaSetDevice(*device) == cudaSuccess) cudaDeviceReset();
  }
  cudaGetLastError();  // clears the error
}

Device find_device(int number) {
  Device device;
  int count = 0;
  const cudaError_t result = cudaGetDeviceCount(&count);
  if (result != cudaSuccess || count == 0) {
    const bool no_driver = result == cudaErrorInsufficientDriver;
    device.why_not = no_driver               ? "no NVIDIA driver, or one too old for this build"
                     : result == cudaSuccess ? "no device answers"
                                             : cudaGetErrorString(result);
    cudaGetLastError();  // clears the error
    return device;
  }
  if (number >= count) {
    device.why_not = "device " + std::to_string(number) + " does not exist, expected 0 to " + std::to_string(count - 1);
    return device;
  }
  try {
    const DeviceScope scope(number);
    cudaDeviceProp properties{};
    PMSP_CUDA_CHECK(cudaGetDeviceProperties(&properties, number));
    device.name = properties.name;
    int clock_khz = 0;
    PMSP_CUDA_CHECK(cudaDeviceGetAttribute(&clock_khz, cudaDevAttrClockRate, number));
    constexpr double kSamplesPerClock = 4.0;  // of a multiprocessor, Turing to Blackwell
    device.texture_rate = kSamplesPerClock * properties.multiProcessorCount * 1e3 * clock_khz;
    std::size_t total = 0;
    PMSP_CUDA_CHECK(cudaMemGetInfo(&device.free_bytes, &total));
    if (!runs_here()) {
      device.why_not = device.name + " (compute capability " + std::to_string(properties.major) + "." +
                       std::to_string(properties.minor) + ") is not among the architectures of this build";
    }
  } catch (const DeviceError& error) {
    device.why_not = error.what();
    cudaGetLastError();
  }
  return device;
}

}  // namespace pmsp::cuda
