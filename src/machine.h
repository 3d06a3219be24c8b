// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/api.h"
#include "pmsp/options.h"

namespace pmsp {

/// Number of CPUs that this process may run on (its affinity mask), at least 1.
PMSP_API int usable_cpus();

/// Lowers the priority of the calling thread, and of those that it starts from now on: `nice` 0 to 19, as of the
/// command; at 19 they run only when nobody else wants to (SCHED_IDLE). Elsewhere than on Linux, where a thread has
/// none of its own, nothing happens.
PMSP_API void run_at_low_priority(int nice);

/// Whether this build holds the CUDA backend; whether a device answers is another matter.
PMSP_API bool has_cuda();

/// The widest instruction set that this machine has and this build holds.
PMSP_API Simd widest_simd();

}  // namespace pmsp
