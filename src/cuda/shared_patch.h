// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_fp16.h>

#include "patch.h"

namespace pmsp::cuda {

constexpr int kPatchThreads = 64;  ///< per block

/// Reference patch in shared memory, in half precision. view_score uses the sums of the rounded values, which prevents
/// rounding from acting like texture.
class SharedPatch {
 public:
  /// `block`: storage for the patches of all threads of the block.
  __device__ explicit SharedPatch(__half2* block) : samples_(block + threadIdx.x + blockDim.x * threadIdx.y) {}

  PMSP_HD float weight(int k) const { return __low2float(samples_[k * kPatchThreads]); }
  PMSP_HD float value(int k) const { return __high2float(samples_[k * kPatchThreads]); }
  PMSP_HD void put(int k, float weight, float value) { samples_[k * kPatchThreads] = __floats2half2_rn(weight, value); }

  float center = 0.0F;
  float variance = 0.0F;
  float weight_sum = 1.0F;
  float value_sum = 0.0F;
  bool fine = false;

 private:
  __half2* samples_;  ///< of this thread, interleaved with those of the other threads
};

}  // namespace pmsp::cuda
