// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/rows.h"

namespace pmsp::cpu {

extern const RowKernels kAvx2Rows;
const RowKernels kAvx2Rows = row_kernels<xsimd::batch<float, xsimd::fma3<xsimd::avx2>>>();

}  // namespace pmsp::cpu
