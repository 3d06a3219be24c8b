// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_fp16.h>

#include "patch.h"

namespace pmsp::cuda {

/// A reference patch in half precision: 36 registers instead of 72, so that it stays in them. The sums of the rounded
/// numbers, which view_score takes into account, keep the rounding from acting like texture.
struct PackedPatch {
  __half2 samples[kernels::kPatchSamples];  ///< weight, contrast
  float variance;
  float weight_sum;
  float contrast_sum;

  PMSP_HD float weight(int k) const { return __low2float(samples[k]); }
  PMSP_HD float contrast(int k) const { return __high2float(samples[k]); }
  PMSP_HD void put(int k, float weight, float contrast) { samples[k] = __floats2half2_rn(weight, contrast); }
};

}  // namespace pmsp::cuda
