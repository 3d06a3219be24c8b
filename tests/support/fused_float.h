// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include "num.h"

// A number type of kernels that is one float, with multiply-adds rounded once on every machine: what a lane of AVX2 or
// AVX-512 must give bit by bit. It also stands for a SIMD library's type: argument-dependent look-up finds elementary
// functions here, so that a kernel which calls one unqualified does not compile.
namespace pmsp::test::fused {

struct Float {
  Float() = default;
  explicit Float(float v) : value(v) {}
  explicit Float(std::int32_t v) : value(static_cast<float>(v)) {}
  explicit operator std::int32_t() const { return static_cast<std::int32_t>(value); }
  explicit operator float() const { return value; }

  float value;
};

inline Float operator+(Float a, Float b) { return Float(a.value + b.value); }
inline Float operator-(Float a, Float b) { return Float(a.value - b.value); }
inline Float operator*(Float a, Float b) { return Float(a.value * b.value); }
inline Float operator/(Float a, Float b) { return Float(a.value / b.value); }
inline bool operator<(Float a, Float b) { return a.value < b.value; }
inline bool operator>(Float a, Float b) { return a.value > b.value; }
inline bool operator<=(Float a, Float b) { return a.value <= b.value; }
inline bool operator>=(Float a, Float b) { return a.value >= b.value; }
inline bool operator==(Float a, Float b) { return a.value == b.value; }

inline Float select(bool mask, Float a, Float b) { return mask ? a : b; }
inline Float min(Float a, Float b) { return Float(kernels::min(a.value, b.value)); }
inline Float max(Float a, Float b) { return Float(kernels::max(a.value, b.value)); }
inline Float abs(Float a) { return Float(std::fabs(a.value)); }
inline Float sqrt(Float a) { return Float(std::sqrt(a.value)); }
inline Float fma(Float a, Float b, Float c) { return Float(std::fma(a.value, b.value, c.value)); }

Float exp(const Float&) = delete;
Float atan_unit(const Float&) = delete;
Float atan2(const Float&, const Float&) = delete;

inline void load(Float& value, const float* from) { value = Float(*from); }
inline void store(Float value, float* to) { *to = value.value; }
inline int append(bool mask, Float value, float* to) {
  *to = value.value;
  return mask ? 1 : 0;
}

}  // namespace pmsp::test::fused

namespace pmsp::kernels {
template <>
struct Num<test::fused::Float> : ScalarNum<test::fused::Float> {
  static UInt bits(test::fused::Float a) { return Num<float>::bits(a.value); }
  static test::fused::Float of_bits(UInt bits) { return test::fused::Float(Num<float>::of_bits(bits)); }
  static UInt gather_words(const std::uint32_t* data, Int index) { return data[index]; }
};
}  // namespace pmsp::kernels
