// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "cost.h"
#include "engine.h"
#include "pmsp/stages.h"

// CUDA backend for the rest of the library. Also available in builds without a toolkit (not_built.cpp).
namespace pmsp::cuda {

#if defined(PMSP_HAVE_CUDA)
constexpr bool kBuilt = true;
#else
constexpr bool kBuilt = false;
#endif

struct Device {
  std::string name;
  std::string why_not;         ///< empty = usable
  std::size_t free_bytes = 0;  ///< of its memory, now
  double texture_rate = 0.0;   ///< maximum rate of bilinear samples [1/s]
};

/// Describes a device, and releases it again.
Device find_device(int number);

/// Number of available devices.
int device_count();

/// Lets devices read each other's memory without the host, if they can.
void enable_peer_access(const std::vector<int>& devices);

/// See close_devices.
void close(const std::vector<int>& devices) noexcept;

/// Stages on the CUDA devices `context.options.devices`. `executor`: for the host's part.
std::unique_ptr<Engine> make_engine(const EngineContext& context, Executor executor);

}  // namespace pmsp::cuda
