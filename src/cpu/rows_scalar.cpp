// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/rows.h"

namespace pmsp::cpu {

extern const RowKernels kScalarRows;
const RowKernels kScalarRows = row_kernels<float>();

}  // namespace pmsp::cpu
