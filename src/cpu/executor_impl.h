// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cpu/row_kernels.h"
#include "pmsp/executor.h"
#include "util/thread_pool.h"

namespace pmsp {

struct Executor::Impl {
  Impl(int threads, Simd set, const cpu::RowKernels& kernels) : pool(threads), simd(set), rows(kernels) {}

  ThreadPool pool;
  Simd simd;
  cpu::RowKernels rows;
};

}  // namespace pmsp
