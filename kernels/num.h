// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "hd.h"

// Kernels are templates over their number type F: float (one pixel; also a CUDA thread), double (reference of the
// tests) or a SIMD batch of floats (one pixel per lane; src/cpu/batch.h). Operations besides + - * / and comparisons
// are defined here for scalars; for batches the same names are found by argument-dependent lookup. All round correctly,
// so that a lane has the bits of the scalar if both fuse multiply-adds, or neither does.
namespace pmsp::kernels {

/// Types and operations of a number type: Int (signed, 32 bits per lane), UInt, Mask (result of a comparison), kLanes,
/// and operations whose result has another type.
template <class F>
struct Num;

/// The 32-bit halves of 64-bit numbers.
template <class UInt>
struct Halves {
  UInt low, high;
};

template <class F>
struct ScalarNum {
  using Int = std::int32_t;
  using UInt = std::uint32_t;
  using Mask = bool;
  static constexpr int kLanes = 1;
  static PMSP_HD F whole(F a) { return static_cast<F>(static_cast<std::int32_t>(a)); }
  static PMSP_HD Int to_int(F a) { return static_cast<std::int32_t>(a); }
  static PMSP_HD UInt to_uint(F a) { return static_cast<UInt>(static_cast<std::int32_t>(a)); }
  static PMSP_HD F from_int(Int a) { return static_cast<F>(a); }
  static PMSP_HD F from_uint(UInt a) { return static_cast<F>(static_cast<std::int32_t>(a)); }
  static PMSP_HD F gather(const float* data, Int index) { return static_cast<F>(data[index]); }
  static PMSP_HD Halves<UInt> gather(const std::uint64_t* data, Int index) {
    const std::uint64_t value = data[index];
    return {static_cast<UInt>(value), static_cast<UInt>(value >> 32U)};
  }
  static PMSP_HD UInt as_uint(Int a) { return static_cast<UInt>(a); }
  static PMSP_HD F load_ring(const float* ring, int k, int count) {
    if (k < 0) k += count;
    return static_cast<F>(ring[k < count ? k : k % count]);
  }
  template <class V, class T>
  static PMSP_HD void store(V value, T* to, int /*count*/) {
    *to = static_cast<T>(value);
  }
  static PMSP_HD void store_bytes(UInt value, std::uint8_t* to, int /*stride*/, int /*count*/) {
    *to = static_cast<std::uint8_t>(value);
  }
  static PMSP_HD UInt gather_bytes(const std::uint8_t* data, Int index) { return data[index]; }
  static PMSP_HD F pow2(Int exponent) {
    const std::uint32_t bits = static_cast<std::uint32_t>(exponent + 127) << 23U;
    float value = 0.0F;
    ::memcpy(&value, &bits, sizeof(value));
    return static_cast<F>(value);
  }
};
template <>
struct Num<float> : ScalarNum<float> {
  static PMSP_HD UInt bits(float a) {
    UInt bits = 0;
    ::memcpy(&bits, &a, sizeof(bits));
    return bits;
  }
  static PMSP_HD float of_bits(UInt bits) {
    float a = 0.0F;
    ::memcpy(&a, &bits, sizeof(a));
    return a;
  }
  static PMSP_HD UInt gather_words(const std::uint32_t* data, Int index) { return data[index]; }
};
template <>
struct Num<double> : ScalarNum<double> {};

template <class F>
using IntOf = typename Num<F>::Int;
template <class F>
using UIntOf = typename Num<F>::UInt;
template <class F>
using MaskOf = typename Num<F>::Mask;

/// mask ? a : b without a branch.
PMSP_HD float select(bool mask, float a, float b) { return mask ? a : b; }
PMSP_HD double select(bool mask, double a, double b) { return mask ? a : b; }

PMSP_HD bool any(bool mask) { return mask; }
PMSP_HD bool all(bool mask) { return mask; }

/// As SIMD instructions: `b` if neither is smaller (larger), as with NaN.
PMSP_HD float min(float a, float b) { return a < b ? a : b; }
PMSP_HD double min(double a, double b) { return a < b ? a : b; }
PMSP_HD float max(float a, float b) { return a > b ? a : b; }
PMSP_HD double max(double a, double b) { return a > b ? a : b; }

PMSP_HD float abs(float a) { return ::fabsf(a); }
PMSP_HD double abs(double a) { return ::fabs(a); }
PMSP_HD float sqrt(float a) { return ::sqrtf(a); }
PMSP_HD double sqrt(double a) { return ::sqrt(a); }

/// a * b + c. Fused (rounded once) if the target of the compiler has an instruction for it; otherwise it would be a
/// library call, so that a plain x86-64 build rounds host floats twice. Never fused for doubles, the reference of the
/// tests.
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
PMSP_HD float fma(float a, float b, float c) { return ::fmaf(a, b, c); }
#else
PMSP_HD float fma(float a, float b, float c) { return a * b + c; }
#endif
PMSP_HD double fma(double a, double b, double c) { return a * b + c; }

/// Integer part of a number >= 0 (or above -1, which gives 0) that fits an Int.
template <class F>
PMSP_HD F whole(const F& a) {
  return Num<F>::whole(a);
}
template <class F>
PMSP_HD IntOf<F> to_int(const F& a) {
  return Num<F>::to_int(a);
}

/// Converts Int or UInt to F. UInt must be below 2^31.
template <class F>
PMSP_HD F from_int(const IntOf<F>& a) {
  return Num<F>::from_int(a);
}
template <class F>
PMSP_HD F from_uint(const UIntOf<F>& a) {
  return Num<F>::from_uint(a);
}

/// Converts an Int >= 0 to UInt.
template <class F>
PMSP_HD UIntOf<F> as_uint(const IntOf<F>& a) {
  return Num<F>::as_uint(a);
}

/// Converts a number >= 0 to UInt.
template <class F>
PMSP_HD UIntOf<F> to_uint(const F& a) {
  return Num<F>::to_uint(a);
}

/// Bit pattern of a number, and number of a bit pattern.
template <class F>
PMSP_HD UIntOf<F> bits_of(const F& a) {
  return Num<F>::bits(a);
}
template <class F>
PMSP_HD F of_bits(const UIntOf<F>& bits) {
  return Num<F>::of_bits(bits);
}
/// mask ? bits : 0 without a branch.
template <class F>
PMSP_HD UIntOf<F> select_bits(const MaskOf<F>& mask, const UIntOf<F>& bits) {
  return bits_of<F>(select(mask, of_bits<F>(bits), F(0)));
}

/// One element per lane from an array.
template <class F>
PMSP_HD F gather(const float* data, const IntOf<F>& index) {
  return Num<F>::gather(data, index);
}
template <class F>
PMSP_HD UIntOf<F> gather_words(const std::uint32_t* data, const IntOf<F>& index) {
  return Num<F>::gather_words(data, index);
}
template <class F>
PMSP_HD UIntOf<F> gather_bytes(const std::uint8_t* data, const IntOf<F>& index) {
  return Num<F>::gather_bytes(data, index);
}
template <class F>
PMSP_HD Halves<UIntOf<F>> gather_halves(const std::uint64_t* data, const IntOf<F>& index) {
  return Num<F>::gather(data, index);
}

/// Consecutive elements of a ring of `count`, one per lane, from element k (any number > -count).
template <class F>
PMSP_HD F load_ring(const float* ring, int k, int count) {
  return Num<F>::load_ring(ring, k, count);
}

/// Writes the first `count` lanes, or all if there are fewer. `value`: an F or a UInt; bytes are `stride` apart.
template <class F, class V, class T>
PMSP_HD void store(const V& value, T* to, int count) {
  Num<F>::store(value, to, count);
}
template <class F>
PMSP_HD void store_bytes(const UIntOf<F>& value, std::uint8_t* to, int stride, int count) {
  Num<F>::store_bytes(value, to, stride, count);
}

/// 2 to the power of an integer between -126 and 127.
template <class F>
PMSP_HD F pow2(const IntOf<F>& exponent) {
  return Num<F>::pow2(exponent);
}

}  // namespace pmsp::kernels
