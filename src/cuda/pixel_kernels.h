// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cpu/row_kernels.h"

// The per-pixel steps as CUDA kernels. Pointers in the jobs are device pointers; jobs and layouts are those of the CPU
// backend. Grids cover half the width (match kernels) or the width (map kernels) in x and the height in y, blocks of
// any shape.
namespace pmsp::cuda {

/// Random planes and candidates; gridDim.z = 2, one for each colour.
__global__ void start_pixels(cpu::MatchJob job);

/// One visit to the pixels of one colour.
__global__ void iterate_pixels(cpu::MatchJob job, int colour, int iteration);

__global__ void median_pixels(cpu::MedianJob job);

/// Comparison with one other map; `out` holds width x height elements here.
__global__ void compare_pixels(cpu::CompareJob job, cpu::CompareRow out);

}  // namespace pmsp::cuda
