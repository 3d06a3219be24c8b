// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "num.h"

namespace pmsp::kernels {

/// Three numbers: a direction, a point, or a plane vector.
template <class F>
struct Vec3 {
  F x, y, z;
};

template <class F>
PMSP_HD Vec3<F> operator+(const Vec3<F>& a, const Vec3<F>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class F>
PMSP_HD Vec3<F> operator-(const Vec3<F>& a, const Vec3<F>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class F>
PMSP_HD Vec3<F> operator*(const F& s, const Vec3<F>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class F>
PMSP_HD F dot(const Vec3<F>& a, const Vec3<F>& b) {
  return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}
template <class F>
PMSP_HD Vec3<F> cross(const Vec3<F>& a, const Vec3<F>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// s * a + b
template <class F>
PMSP_HD Vec3<F> fma(const F& s, const Vec3<F>& a, const Vec3<F>& b) {
  return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.z, b.z)};
}
template <class F>
PMSP_HD Vec3<F> normalized(const Vec3<F>& a) {
  return (F(1) / sqrt(dot(a, a))) * a;
}
template <class F, class M>
PMSP_HD Vec3<F> select(const M& mask, const Vec3<F>& a, const Vec3<F>& b) {
  return {select(mask, a.x, b.x), select(mask, a.y, b.y), select(mask, a.z, b.z)};
}

}  // namespace pmsp::kernels
