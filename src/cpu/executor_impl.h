// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cpu/row_kernels.h"
#include "pmsp/stages.h"
#include "util/inside.h"
#include "util/thread_pool.h"

namespace pmsp {

struct Executor::Impl {
  Impl(int threads, Simd set, const cpu::RowKernels& kernels) : pool(threads), simd(set), rows(kernels) {}

  /// Runs a stage over all rows, in batches if it is compiled for each instruction set, else pixel by pixel. Returns
  /// its counts.
  template <class Stage>
  std::array<std::int64_t, Stage::kCounts> run(const Stage& stage) {
    const auto row = [&] {
      if constexpr (cpu::has_rows<Stage>(cpu::RowStages{})) {
        return std::get<cpu::RowOf<Stage>>(rows.stages).row;
      } else {
        static_assert(Stage::kCounts == 0, "only batches are counted");
        return [](const Stage& pixels, int y, std::int64_t* /*counts*/) {
          for (int x = 0; x < pixels.width(); ++x) pixels(kernels::single_pixel(x, y, pixels.width()), nullptr);
        };
      }
    }();
    std::vector<std::array<std::int64_t, Stage::kCounts + 1>> counts(static_cast<std::size_t>(stage.height()));
    pool.for_each(stage.height(), [&](int y) { row(stage, y, counts[static_cast<std::size_t>(y)].data()); });
    std::array<std::int64_t, Stage::kCounts> sums{};
    for (const auto& of_row : counts) {
      for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += of_row[i];
    }
    return sums;
  }

  ThreadPool pool;
  Simd simd;
  cpu::RowKernels rows;
};

/// Calls `task` with 0 to count - 1, on an executor's threads, or on this thread if nullptr.
template <class Task>
void for_each(const Executor* executor, int count, const Task& task) {
  if (executor != nullptr) {
    pool_of(*executor).for_each(count, task);
  } else {
    for (int i = 0; i < count; ++i) task(i);
  }
}

}  // namespace pmsp
