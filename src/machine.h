// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/api.h"
#include "pmsp/options.h"

namespace pmsp {

/// Returns the number of CPUs available to the process (affinity mask), at least 1.
PMSP_API int usable_cpus();

/// Lowers the priority of the calling thread and of threads that it starts later. `nice`: 0 to 19, as of the command;
/// 19 = idle cores only (SCHED_IDLE). No effect outside Linux, where threads have no priority of their own.
PMSP_API void run_at_low_priority(int nice);

/// Whether the build includes CUDA, with or without a device.
PMSP_API bool has_cuda();

/// Returns the widest instruction set of build and machine.
PMSP_API Simd widest_simd();

}  // namespace pmsp
