// SPDX-License-Identifier: BSD-2-Clause
#include "make_engine.h"
#include "machine.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "cpu/cpu_engine.h"
#include "cuda/cuda_engine.h"
#include "devices.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

namespace pmsp {
namespace {

std::size_t memory_without_scratch(DensifierOptions options) {
  options.scratch_folder.clear();
  return device_memory_needed(options);
}

/// Returns the reason; empty if the memory suffices or the size of the depth maps is unknown.
std::string why_too_small(const cuda::Device& device, const DensifierOptions& options) {
  if (options.width == 0 || options.height == 0) return {};
  const std::size_t needed = std::min(device_memory_needed(options), memory_without_scratch(options));
  if (needed <= device.free_bytes) return {};
  return device.name + " has " + std::to_string(device.free_bytes >> 20U) + " MiB free, but " +
         std::to_string(options.width) + " x " + std::to_string(options.height) + " takes " +
         std::to_string(needed >> 20U) + " MiB" +
         (options.scratch_folder.empty() ? "; a scratch directory may help (scratch_folder)" : "");
}

/// Whether all waiting artefacts fit into the device. False for unordered sets: there all keyframes wait, and estimates
/// are for sequences.
bool needs_no_scratch(const cuda::Device& device, const DensifierOptions& options) {
  return options.width > 0 && options.height > 0 && !options.unordered &&
         memory_without_scratch(options) <= device.free_bytes;
}

}  // namespace

bool has_cuda() { return cuda::kBuilt; }

void close_devices(const std::vector<int>& devices) noexcept { cuda::close(devices); }

std::size_t free_device_memory(int device) {
  const cuda::Device found = cuda::find_device(device);
  return found.why_not.empty() ? found.free_bytes : 0;
}

int device_count() { return std::min(kMaxDevices, cuda::device_count()); }

std::unique_ptr<Engine> make_engine(const EngineContext& context, DensifierOptions& options, std::string& description) {
  Executor executor(options.threads, options.simd);
  options.threads = executor.threads();
  options.simd = executor.simd();
  std::string why_not;
  if (options.backend != Backend::kCpu) {
    std::vector<int> devices = options.devices;
    for (int k = 0; options.devices.empty() && k < std::max(1, device_count()); ++k) {
      devices.push_back(k);
    }
    DensifierOptions shared = options;
    shared.devices = devices;
    bool keeps_scratch = false;
    std::string names;
    for (const int number : devices) {
      cuda::Device device = cuda::find_device(number);
      device.free_bytes /= static_cast<std::size_t>(std::count(devices.begin(), devices.end(), number));
      why_not = device.why_not;
      if (why_not.empty()) why_not = why_too_small(device, shared);
      if (!why_not.empty()) break;
      keeps_scratch = keeps_scratch || !needs_no_scratch(device, shared);
      names += (names.empty() ? "CUDA device " : "; device ") + std::to_string(number) + ", " + device.name;
    }
    if (why_not.empty()) {
      if (!keeps_scratch) options.scratch_folder.clear();
      options.backend = Backend::kCuda;
      options.devices = devices;
      description = names;
      return cuda::make_engine(context, std::move(executor));
    }
    if (options.backend == Backend::kCuda) {
      throw BackendUnavailable("backend cuda: " + why_not + "; use backend cpu, or auto, which falls back to it");
    }
  }
  options.backend = Backend::kCpu;
  description = "CPU, " + std::to_string(options.threads) + (options.threads == 1 ? " thread, " : " threads, ") +
                name_of(options.simd);
  if (!why_not.empty()) description += " (CUDA: " + why_not + ")";
  return cpu::make_engine(context, std::move(executor));
}

}  // namespace pmsp
