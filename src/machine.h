// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/api.h"
#include "pmsp/options.h"

namespace pmsp {

/// Number of CPUs that this process may run on (its affinity mask), at least 1.
PMSP_API int usable_cpus();

/// Lowers the priority of the calling thread and of threads that it starts later. `nice`: 0 to 19, as of the command;
/// 19: on idle cores only (SCHED_IDLE). No effect outside Linux, where threads have no priority of their own.
PMSP_API void run_at_low_priority(int nice);

/// Whether CUDA is built in, with or without a device.
PMSP_API bool has_cuda();

/// The widest instruction set of this build and machine.
PMSP_API Simd widest_simd();

}  // namespace pmsp
