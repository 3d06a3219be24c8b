// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// All compiler-specific code. PMSP_HD marks functions for host and device; always inlined, so that code for wide vector
// instructions is never linked into code for other machines. PMSP_UNROLL precedes loops whose arrays a GPU keeps in
// registers only if they are unrolled; PMSP_ROLL prevents unrolling.
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

/// Sets bits of a word, atomically.
PMSP_HD void set_bits(std::uint32_t* word, std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  atomicOr(word, bits);
#else
  __atomic_fetch_or(word, bits, __ATOMIC_RELAXED);
#endif
}

}  // namespace pmsp::kernels
