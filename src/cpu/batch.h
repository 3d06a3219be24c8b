// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <xsimd/xsimd.hpp>

#include "num.h"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

#if defined(__AVX512F__)
namespace xsimd {

// xsimd (8.1) has no fused multiply-add for AVX-512 and would round twice, unlike for AVX2. This one is no template and
// therefore preferred to xsimd's.
PMSP_HD batch<float, avx512bw> fma(const batch<float, avx512bw>& a, const batch<float, avx512bw>& b,
                                   const batch<float, avx512bw>& c) {
  return _mm512_fmadd_ps(a, b, c);
}

}  // namespace xsimd
#endif

// xsimd's batches as the number type of the kernels. Lanes must have the same bits at any width: nothing approximate of
// xsimd may be used (reciprocal, rsqrt), and no elementary functions (kernels/elementary.h).
namespace pmsp::kernels {

// Gathers use instructions of the CPU: xsimd's (8.1) reads lane by lane on all instruction sets, which slows down
// PatchMatch.

template <class F, class Int>
PMSP_HD F gather_lanes(const float* data, const Int& index) {
#if defined(__AVX512F__)
  if constexpr (F::size == 16) return F(_mm512_i32gather_ps(index, data, 4));
#endif
#if defined(__AVX2__)
  if constexpr (F::size == 8) return F(_mm256_i32gather_ps(data, index, 4));
#endif
  return F::gather(data, index);
}

template <class UInt, class Int>
PMSP_HD UInt gather_words_of_lanes(const std::uint32_t* data, const Int& index) {
#if defined(__AVX512F__)
  if constexpr (UInt::size == 16) return UInt(_mm512_i32gather_epi32(index, data, 4));
#endif
#if defined(__AVX2__)
  if constexpr (UInt::size == 8) return UInt(_mm256_i32gather_epi32(reinterpret_cast<const int*>(data), index, 4));
#endif
  alignas(64) std::uint32_t words[UInt::size];
  for (std::size_t i = 0; i < UInt::size; ++i) words[i] = data[index.get(i)];
  return UInt::load_aligned(words);
}

template <class UInt, class Int>
PMSP_HD Halves<UInt> gather_halves_of_lanes(const std::uint64_t* data, const Int& index) {
#if defined(__AVX512F__)
  if constexpr (UInt::size == 16) {
    const __m512i indices = index;
    const __m512i first = _mm512_i32gather_epi64(_mm512_castsi512_si256(indices), data, 8);
    const __m512i last = _mm512_i32gather_epi64(_mm512_extracti64x4_epi64(indices, 1), data, 8);
    const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
    const __m512i odd = _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
    return {UInt(_mm512_permutex2var_epi32(first, even, last)), UInt(_mm512_permutex2var_epi32(first, odd, last))};
  }
#endif
#if defined(__AVX2__)
  if constexpr (UInt::size == 8) {
    const auto* const numbers = reinterpret_cast<const long long*>(data);
    const __m256i indices = index;
    const __m256 first = _mm256_castsi256_ps(_mm256_i32gather_epi64(numbers, _mm256_castsi256_si128(indices), 8));
    const __m256 last = _mm256_castsi256_ps(_mm256_i32gather_epi64(numbers, _mm256_extracti128_si256(indices, 1), 8));
    const __m256i low = _mm256_castps_si256(_mm256_shuffle_ps(first, last, 0x88));  // lanes 0 1 4 5 2 3 6 7
    const __m256i high = _mm256_castps_si256(_mm256_shuffle_ps(first, last, 0xdd));
    return {UInt(_mm256_permute4x64_epi64(low, 0xd8)), UInt(_mm256_permute4x64_epi64(high, 0xd8))};
  }
#endif
  alignas(64) std::uint32_t low[UInt::size];
  alignas(64) std::uint32_t high[UInt::size];
  for (std::size_t i = 0; i < UInt::size; ++i) {
    const std::uint64_t value = data[index.get(i)];
    low[i] = static_cast<std::uint32_t>(value);
    high[i] = static_cast<std::uint32_t>(value >> 32U);
  }
  return {UInt::load_aligned(low), UInt::load_aligned(high)};
}

/// xsimd::bitwise_cast to a batch type; from xsimd 11 on, its argument is the type of a lane.
template <class To, class From>
PMSP_HD To bits_as(const From& from) {
#if XSIMD_VERSION_MAJOR >= 11
  return xsimd::bitwise_cast<typename To::value_type>(from);
#else
  return xsimd::bitwise_cast<To>(from);
#endif
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
  static PMSP_HD UInt to_uint(const F& a) { return bits_as<UInt>(xsimd::to_int(a)); }
  static PMSP_HD F from_int(const Int& a) { return xsimd::to_float(a); }
  static PMSP_HD F from_uint(const UInt& a) { return xsimd::to_float(bits_as<Int>(a)); }
  static PMSP_HD UInt bits(const F& a) { return bits_as<UInt>(a); }
  static PMSP_HD F of_bits(const UInt& bits) { return bits_as<F>(bits); }
  static PMSP_HD F gather(const float* data, const Int& index) { return gather_lanes<F>(data, index); }
  static PMSP_HD UInt gather_words(const std::uint32_t* data, const Int& index) {
    return gather_words_of_lanes<UInt>(data, index);
  }
  static PMSP_HD Halves<UInt> gather(const std::uint64_t* data, const Int& index) {
    return gather_halves_of_lanes<UInt>(data, index);
  }
  static PMSP_HD UInt as_uint(const Int& a) { return bits_as<UInt>(a); }
  static PMSP_HD UInt gather_bytes(const std::uint8_t* data, const Int& index) {
    alignas(64) std::int32_t at[F::size];
    alignas(64) std::uint32_t bytes[F::size];
    index.store_aligned(at);
    for (std::size_t i = 0; i < F::size; ++i) bytes[i] = data[at[i]];
    return UInt::load_aligned(bytes);
  }
  static PMSP_HD F load_ring(const float* ring, int k, int count) {
    if (k < 0) k += count;
    if (k >= count) k %= count;
    if (k + kLanes <= count) return F::load_unaligned(ring + k);
    float wrapped[F::size];
    for (float& value : wrapped) {
      value = ring[k];
      k = k + 1 == count ? 0 : k + 1;
    }
    return F::load_unaligned(wrapped);
  }
  template <class T>
  static PMSP_HD void store(const xsimd::batch<T, Arch>& value, T* to, int count) {
    if (count >= kLanes) return value.store_unaligned(to);
    T all[F::size];
    value.store_unaligned(all);
    for (int i = 0; i < count; ++i) to[i] = all[i];
  }
  static PMSP_HD void store_bytes(const UInt& value, std::uint8_t* to, int stride, int count) {
    std::uint32_t all[F::size];
    value.store_unaligned(all);
    for (int i = 0; i < kLanes && i < count; ++i) to[i * stride] = static_cast<std::uint8_t>(all[i]);
  }
  static PMSP_HD F pow2(const Int& exponent) { return bits_as<F>(Int(exponent + Int(127)) << 23); }
};

}  // namespace pmsp::kernels
