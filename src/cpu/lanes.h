// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "batch.h"
#include "num.h"

// Loads and stores of lanes, for scalars and batches alike.
namespace pmsp::cpu {

using kernels::IntOf;
using kernels::Num;
using kernels::select;
using kernels::UIntOf;

/// Number of elements of a value: 1 for scalars.
template <class V>
struct LaneCount {
  static constexpr int kValue = 1;
};
template <class T, class A>
struct LaneCount<xsimd::batch<T, A>> {
  static constexpr int kValue = static_cast<int>(xsimd::batch<T, A>::size);
};
template <class V>
constexpr int lanes() {
  return LaneCount<V>::kValue;
}

PMSP_HD void load(float& value, const float* from) { value = *from; }
PMSP_HD void load(std::int32_t& value, const std::int32_t* from) { value = *from; }
PMSP_HD void load(std::uint32_t& value, const std::uint32_t* from) { value = *from; }
PMSP_HD void store(float value, float* to) { *to = value; }
PMSP_HD void store(std::int32_t value, std::int32_t* to) { *to = value; }
PMSP_HD void store(std::uint32_t value, std::uint32_t* to) { *to = value; }
template <class T, class A>
PMSP_HD void load(xsimd::batch<T, A>& value, const T* from) {
  value = xsimd::batch<T, A>::load_unaligned(from);
}
template <class T, class A>
PMSP_HD void store(const xsimd::batch<T, A>& value, T* to) {
  value.store_unaligned(to);
}
/// Writes the lanes selected by the mask consecutively, and returns their number. May overwrite as many elements as
/// there are lanes.
PMSP_HD int append(bool mask, float value, float* to) {
  *to = value;
  return mask ? 1 : 0;
}
PMSP_HD int append(bool mask, std::int32_t value, std::int32_t* to) {
  *to = value;
  return mask ? 1 : 0;
}
#if defined(__AVX512F__)
template <class A>
PMSP_HD int append(const xsimd::batch_bool<float, A>& mask, const xsimd::batch<float, A>& value, float* to) {
  const __mmask16 bits = mask;
  _mm512_storeu_ps(to, _mm512_maskz_compress_ps(bits, value));
  return __builtin_popcount(bits);
}
template <class A>
PMSP_HD int append(const xsimd::batch_bool<float, A>& mask, const xsimd::batch<std::int32_t, A>& value,
                   std::int32_t* to) {
  const __mmask16 bits = mask;
  _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(bits, value));
  return __builtin_popcount(bits);
}
#elif defined(__AVX2__)
template <class T, class A>
PMSP_HD int append(const xsimd::batch_bool<float, A>& mask, const xsimd::batch<T, A>& value, T* to) {
  T all[xsimd::batch<T, A>::size];
  value.store_unaligned(all);
  int count = 0;
  for (unsigned bits = static_cast<unsigned>(_mm256_movemask_ps(mask)); bits != 0; bits &= bits - 1) {
    to[count++] = all[__builtin_ctz(bits)];
  }
  return count;
}
#endif

/// 0, 1, 2, ...
template <class F>
PMSP_HD F lane_numbers() {
  static constexpr float kNumbers[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  F value;
  load(value, kNumbers);
  return value;
}

/// Columns of a row from `first` on; lanes beyond the last column repeat it.
template <class F>
PMSP_HD IntOf<F> columns_from(int first, int width) {
  const F last(static_cast<float>(width - 1));
  const F column = lane_numbers<F>() + F(static_cast<float>(first));
  return kernels::to_int<F>(select(column < last, column, last));
}

}  // namespace pmsp::cpu
