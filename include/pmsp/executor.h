// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>

#include "pmsp/api.h"
#include "pmsp/options.h"

namespace pmsp {

/// The threads and the instruction set that stages run on. Results never depend on the number of threads; AVX2 and
/// AVX-512 give the same. One executor serves one stage at a time; several executors do not disturb each other.
class PMSP_API Executor {
 public:
  /// `threads`: 1 to 1024, or 0 for one for each CPU that the process may use. Throws InvalidOption for other numbers,
  /// BackendUnavailable when this machine lacks the instruction set.
  explicit Executor(int threads = 0, Simd simd = Simd::kAuto);
  ~Executor();
  Executor(Executor&&) noexcept;
  Executor& operator=(Executor&&) noexcept;

  int threads() const;  ///< in force
  Simd simd() const;    ///< never kAuto

 private:
  friend struct Inside;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

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
