// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// The one place that knows which compiler is at work. PMSP_HD marks a function that runs on the host and on a device;
// it is always inlined, so that a function compiled with wide vector instructions never becomes the copy that a
// narrower machine calls. PMSP_UNROLL stands before loops whose arrays a GPU keeps in registers only if it unrolls
// them.
#if defined(__CUDACC__)
#define PMSP_HD __host__ __device__ __forceinline__
#define PMSP_UNROLL _Pragma("unroll")
#define PMSP_ROLL _Pragma("unroll 1")
#else
#define PMSP_HD inline __attribute__((always_inline))
#define PMSP_UNROLL
#define PMSP_ROLL
#endif

#include <cstdint>

namespace pmsp::kernels {

/// Adds bits to a word that other threads may add theirs to.
PMSP_HD void set_bits(std::uint32_t* word, std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  atomicOr(word, bits);
#else
  __atomic_fetch_or(word, bits, __ATOMIC_RELAXED);
#endif
}

}  // namespace pmsp::kernels
