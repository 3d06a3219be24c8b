// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "cost.h"
#include "engine.h"
#include "pmsp/stages.h"

// What the rest of the library knows of CUDA. Builds without a toolkit have it too (not_built.cpp).
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
  double texture_rate = 0.0;   ///< bilinear samples that its texture units filter in a second, at most
};

/// Looks at one device, and lets go of it again.
Device find_device(int number);

/// Number of devices that answer.
int device_count();

/// Devices read each other's memory without the host between them, where they can.
void connect(const std::vector<int>& devices);

/// See close_devices.
void close(const std::vector<int>& devices) noexcept;

/// The stages on the CUDA devices `context.options.devices`. `executor`: for what little the host does.
std::unique_ptr<Engine> make_engine(const EngineContext& context, Executor executor);

}  // namespace pmsp::cuda
