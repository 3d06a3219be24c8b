// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <xsimd/xsimd.hpp>

#include "num.h"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

// xsimd's batches as the number type of the kernels.
namespace pmsp::kernels {

/// One element of 32 bits per lane, by the machine's own instruction: xsimd's gather (8.1) reads lane by lane on all
/// instruction sets, which makes it a quarter to a half of PatchMatch's time.
template <class V, class Int>
PMSP_HD V gather_lanes(const typename V::value_type* data, const Int& index) {
#if defined(__AVX512F__)
  if constexpr (V::size == 16) return xsimd::bitwise_cast<V>(Int(_mm512_i32gather_epi32(index, data, 4)));
#endif
#if defined(__AVX2__)
  if constexpr (V::size == 8) {
    return xsimd::bitwise_cast<V>(Int(_mm256_i32gather_epi32(reinterpret_cast<const int*>(data), index, 4)));
  }
#endif
  return V::gather(data, index);
}

template <class Arch>
struct Num<xsimd::batch<float, Arch>> {
  using F = xsimd::batch<float, Arch>;
  using Int = xsimd::batch<std::int32_t, Arch>;
  using UInt = xsimd::batch<std::uint32_t, Arch>;
  using Mask = xsimd::batch_bool<float, Arch>;
  static constexpr int kLanes = static_cast<int>(F::size);
  static PMSP_HD F whole(const F& a) { return xsimd::trunc(a); }
  static PMSP_HD Int to_int(const F& a) { return xsimd::to_int(a); }
  static PMSP_HD F from_int(const Int& a) { return xsimd::to_float(a); }
  static PMSP_HD F from_uint(const UInt& a) { return xsimd::to_float(xsimd::bitwise_cast<Int>(a)); }
  static PMSP_HD F gather(const float* data, const Int& index) { return gather_lanes<F>(data, index); }
  static PMSP_HD UInt gather(const std::uint32_t* data, const Int& index) { return gather_lanes<UInt>(data, index); }
  static PMSP_HD F pow2(const Int& exponent) { return xsimd::bitwise_cast<F>(Int(exponent + Int(127)) << 23); }
};

}  // namespace pmsp::kernels
