// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <bitset>

#include "cpu/duplicate_row.h"
#include "cpu/lanes.h"
#include "cpu/row_kernels.h"

// Row functions for a number type; each instruction set's file instantiates them with its batch.
namespace pmsp::cpu {

/// Number of set lanes of a mask among the first `count`.
template <class F>
PMSP_HD int count_lanes(const kernels::MaskOf<F>& mask, int count) {
  float held[lanes<F>()];
  store(select(mask, F(1), F(0)), held);
  int sum = 0;
  for (int i = 0; i < lanes<F>() && i < count; ++i) sum += held[i] > 0.0F ? 1 : 0;
  return sum;
}

template <class F, class Stage>
void stage_row(const Stage& stage, int y, std::int64_t* counts) {
  const int width = stage.width();
  for (int x = 0; x < width; x += lanes<F>()) {
    const IntOf<F> column = columns_from<F>(x, width);
    const int row = y * width;
    const kernels::RowPixels<F> at{column, IntOf<F>(row) + column, y, row + x, width - x};
    kernels::MaskOf<F> counted[Stage::kCounts + 1];
    stage(at, counted);
    for (int i = 0; i < Stage::kCounts; ++i) counts[i] += count_lanes<F>(counted[i], width - x);
  }
}

/// Pixels of a colour from the k-th on, one per lane.
template <class F>
PMSP_HD kernels::PixelBatch<F> batch_of(const PatchMatchPass& pass, int y, int colour, int k) {
  const int half = pass.grid.width / 2;
  const IntOf<F> column = columns_from<F>(k, half) * IntOf<F>(2) + IntOf<F>((y + colour) & 1);
  return {y,
          colour,
          k,
          half - k,
          kernels::ring_index(pass.grid.width, y, colour),
          column,
          IntOf<F>(y * pass.grid.width) + column};
}

template <class F>
void start_row(const PatchMatchPass& pass, int y) {
  kernels::PixelContext<F> context;
  for (int colour = 0; colour < 2; ++colour) {
    for (int k = 0; k < pass.grid.width / 2; k += lanes<F>()) pass.start(context, batch_of<F>(pass, y, colour, k));
  }
}

template <class F>
void iterate_row(const PatchMatchPass& pass, int y, int colour, int iteration, bool rescore) {
  kernels::PixelContext<F> context;
  for (int k = 0; k < pass.grid.width / 2; k += lanes<F>()) {
    pass.iterate(context, batch_of<F>(pass, y, colour, k), iteration, rescore);
  }
}

template <class F, class... Stages>
constexpr std::tuple<RowOf<Stages>...> stage_rows(StageList<Stages...> /*list*/) {
  return {RowOf<Stages>{&stage_row<F, Stages>}...};
}

template <class F>
constexpr RowKernels row_kernels() {
  return {stage_rows<F>(RowStages{}), &start_row<F>, &iterate_row<F>, &duplicate_row<F>};
}

}  // namespace pmsp::cpu
