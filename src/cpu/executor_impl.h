// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cpu/row_kernels.h"
#include "pmsp/executor.h"
#include "util/thread_pool.h"

namespace pmsp {

struct Executor::Impl {
  Impl(int threads, Simd set, const cpu::RowKernels& kernels) : pool(threads), simd(set), rows(kernels) {}

  /// Runs a stage over all rows; returns what it counts.
  template <class Stage>
  std::array<std::int64_t, Stage::kCounts> run(const Stage& stage) {
    const auto row = std::get<cpu::RowOf<Stage>>(rows.stages).row;
    std::vector<std::array<std::int64_t, Stage::kCounts + 1>> counts(static_cast<std::size_t>(stage.height()));
    pool.for_each(stage.height(), [&](int y) { row(stage, y, counts[static_cast<std::size_t>(y)].data()); });
    std::array<std::int64_t, Stage::kCounts> sums{};
    for (const auto& of_row : counts) {
      for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += of_row[i];
    }
    return sums;
  }
  /// Runs a stage pixel by pixel.
  template <class Stage>
  void run_plainly(const Stage& stage) {
    pool.for_each(stage.height(), [&](int y) {
      for (int x = 0; x < stage.width(); ++x) stage(kernels::place_of(x, y, stage.width()), nullptr);
    });
  }

  ThreadPool pool;
  Simd simd;
  cpu::RowKernels rows;
};

}  // namespace pmsp
