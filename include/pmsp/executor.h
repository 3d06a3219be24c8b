// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>

#include "pmsp/options.h"

namespace pmsp {

/// The threads and the instruction set that stages run on. Results never depend on the number of threads; AVX2 and
/// AVX-512 give the same. One executor serves one stage at a time; several executors do not disturb each other.
class Executor {
 public:
  /// `threads`: 1 to 1024, or 0 for one for each CPU that the process may use. Throws InvalidOption for other numbers,
  /// BackendUnavailable when this machine lacks the instruction set.
  explicit Executor(int threads = 0, Simd simd = Simd::kAuto);
  ~Executor();
  Executor(Executor&&) noexcept;
  Executor& operator=(Executor&&) noexcept;

  int threads() const;
  Simd simd() const;  ///< never kAuto

  struct Impl;
  Impl& impl() const { return *impl_; }  ///< for the stages

 private:
  std::unique_ptr<Impl> impl_;
};

/// Whether this build holds the CUDA backend; whether a device answers is another matter.
bool has_cuda();

/// The widest instruction set that this machine has and this build holds.
Simd widest_simd();

}  // namespace pmsp
