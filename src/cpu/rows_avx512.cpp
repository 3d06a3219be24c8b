// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/rows.h"

namespace pmsp::cpu {

extern const RowKernels kAvx512Rows;
const RowKernels kAvx512Rows = row_kernels<xsimd::batch<float, xsimd::avx512bw>>();

}  // namespace pmsp::cpu
