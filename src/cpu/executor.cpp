// SPDX-License-Identifier: BSD-2-Clause
#include "machine.h"
#include "pmsp/stages.h"

#include <algorithm>
#include <thread>

#if defined(__linux__)
#include <sched.h>
#endif

#include "cpu/executor_impl.h"
#include "pmsp/error.h"

namespace pmsp {

namespace cpu {
extern const RowKernels kScalarRows;
#if defined(PMSP_X86_ROWS)
extern const RowKernels kAvx2Rows;
extern const RowKernels kAvx512Rows;
#endif
}  // namespace cpu

namespace {

bool has(Simd simd) {
#if defined(PMSP_X86_ROWS)
  if (simd == Simd::kAvx512) {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512cd") &&
           __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("fma");
  }
  if (simd == Simd::kAvx2) return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif
  return simd == Simd::kScalar;
}

const cpu::RowKernels& rows_of(Simd simd) {
#if defined(PMSP_X86_ROWS)
  if (simd == Simd::kAvx512) return cpu::kAvx512Rows;
  if (simd == Simd::kAvx2) return cpu::kAvx2Rows;
#endif
  (void)simd;
  return cpu::kScalarRows;
}

}  // namespace

int usable_cpus() {
#if defined(__linux__)
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof(set), &set) == 0) return std::max(1, CPU_COUNT(&set));
#endif
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

Simd widest_simd() {
  if (has(Simd::kAvx512)) return Simd::kAvx512;
  if (has(Simd::kAvx2)) return Simd::kAvx2;
  return Simd::kScalar;
}

Executor::Executor(int threads, Simd simd) {
  if (threads < 0 || threads > 1024) {
    throw InvalidOption("threads is " + std::to_string(threads) + "; expected 1 to 1024, or 0 for one for each CPU");
  }
  const Simd chosen = simd == Simd::kAuto ? widest_simd() : simd;
  if (!has(chosen)) {
    throw BackendUnavailable(std::string("this machine or build has no ") + name_of(chosen) + "; use simd auto (here " +
                             name_of(widest_simd()) + ")");
  }
  impl_ = std::make_unique<Impl>(threads, chosen, rows_of(chosen));
}

Executor::~Executor() = default;
Executor::Executor(Executor&&) noexcept = default;
Executor& Executor::operator=(Executor&&) noexcept = default;

ThreadPool& pool_of(const Executor& executor) { return impl_of(executor).pool; }

int Executor::threads() const { return impl_->pool.threads(); }
Simd Executor::simd() const { return impl_->simd; }

}  // namespace pmsp
