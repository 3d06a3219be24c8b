// SPDX-License-Identifier: BSD-2-Clause
#include "make_engine.h"

#include <utility>

#include "cpu/cpu_engine.h"
#include "cuda/cuda_engine.h"
#include "pmsp/error.h"
#include "pmsp/executor.h"

namespace pmsp {
namespace {

/// Empty where the memory suffices, or as long as the size of the depth maps is not known. Takes the scratch folder
/// from the options where nothing need be put aside.
std::string why_too_small(const cuda::Device& device, DensifierOptions& options) {
  if (options.width == 0 || options.height == 0) return {};
  DensifierOptions in_memory = options;
  in_memory.scratch_folder.clear();
  if (cuda::memory_needed(in_memory) <= device.free_bytes) {
    options.scratch_folder.clear();
    return {};
  }
  const std::size_t needed = cuda::memory_needed(options);
  if (needed <= device.free_bytes) return {};
  return device.name + " has " + std::to_string(device.free_bytes >> 20U) + " MiB free, but " +
         std::to_string(options.width) + " x " + std::to_string(options.height) + " takes " +
         std::to_string(needed >> 20U) + " MiB" +
         (options.scratch_folder.empty() ? "; a scratch folder may help (scratch_folder)" : "");
}

}  // namespace

bool has_cuda() { return cuda::kBuilt; }

std::unique_ptr<Engine> make_engine(const EngineContext& context, DensifierOptions& options, std::string& description) {
  Executor executor(options.threads, options.simd);
  options.threads = executor.threads();
  options.simd = executor.simd();
  std::string why_not;
  if (options.backend != Backend::kCpu) {
    const cuda::Device device = cuda::find_device(options.device);
    why_not = device.why_not;
    if (why_not.empty()) why_not = why_too_small(device, options);
    if (why_not.empty()) {
      options.backend = Backend::kCuda;
      description = "CUDA device " + std::to_string(options.device) + ", " + device.name;
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
