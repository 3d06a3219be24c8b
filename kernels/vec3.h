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

/// `target_from_source` in single precision: the same for all pixels of a keyframe. Rotation row-major.
struct Rigid {
  float r[9];
  float t[3];
};

template <class F>
PMSP_HD Vec3<F> rotate(const Rigid& m, const Vec3<F>& a) {
  return {fma(F(m.r[0]), a.x, fma(F(m.r[1]), a.y, F(m.r[2]) * a.z)),
          fma(F(m.r[3]), a.x, fma(F(m.r[4]), a.y, F(m.r[5]) * a.z)),
          fma(F(m.r[6]), a.x, fma(F(m.r[7]), a.y, F(m.r[8]) * a.z))};
}
template <class F>
PMSP_HD Vec3<F> rotate_back(const Rigid& m, const Vec3<F>& a) {
  return {fma(F(m.r[0]), a.x, fma(F(m.r[3]), a.y, F(m.r[6]) * a.z)),
          fma(F(m.r[1]), a.x, fma(F(m.r[4]), a.y, F(m.r[7]) * a.z)),
          fma(F(m.r[2]), a.x, fma(F(m.r[5]), a.y, F(m.r[8]) * a.z))};
}
template <class F>
PMSP_HD Vec3<F> translation(const Rigid& m) {
  return {F(m.t[0]), F(m.t[1]), F(m.t[2])};
}
template <class F>
PMSP_HD Vec3<F> transform(const Rigid& m, const Vec3<F>& a) {
  return rotate(m, a) + translation<F>(m);
}

}  // namespace pmsp::kernels
