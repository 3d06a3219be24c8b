// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "num.h"

// Transcendental functions without branches and library calls. Number types whose fma rounds once give equal bits, and
// so do those whose fma rounds twice; the two groups differ by up to two units in the last place. Errors are tested
// against the standard library's double precision (tests/kernels).
//
// Call them qualified (kernels::exp): for batches, argument-dependent lookup of plain names finds those of the SIMD
// library.
namespace pmsp::kernels {

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180.0;  ///< [rad]

/// exp(x) for -80 <= x <= 80. Relative error below 3e-7 in single precision. Cody-Waite reduction, then a polynomial on
/// [-ln 2 / 2, ln 2 / 2] (Taylor to the sixth degree).
template <class F>
PMSP_HD F exp(const F& x) {
  const F shifted = fma(x, F(1.44269504088896F), F(128.5F));  // > 0, so that its whole part rounds down
  const F n = whole(shifted) - F(128);
  const F r = fma(n, F(-0.693359375F), x) + n * F(2.12194440e-4F);
  F p = F(1.0F / 720.0F);
  p = fma(p, r, F(1.0F / 120.0F));
  p = fma(p, r, F(1.0F / 24.0F));
  p = fma(p, r, F(1.0F / 6.0F));
  p = fma(p, r, F(0.5F));
  p = fma(p, r, F(1));
  p = fma(p, r, F(1));
  return p * pow2<F>(to_int(shifted) - IntOf<F>(128));
}

/// atan(x) for 0 <= x <= 1, by an odd minimax polynomial; absolute error below 2e-7 (rounding; that of the polynomial
/// is below 2.5e-8).
template <class F>
PMSP_HD F atan_unit(const F& x) {
  const F s = x * x;
  F p = F(0.0026222256F);
  p = fma(p, s, F(-0.0151324584F));
  p = fma(p, s, F(0.0411217293F));
  p = fma(p, s, F(-0.0736669462F));
  p = fma(p, s, F(0.1057392645F));
  p = fma(p, s, F(-0.1418597378F));
  p = fma(p, s, F(0.1999039642F));
  p = fma(p, s, F(-0.3333298705F));
  return fma(p * s, x, x);
}

/// Angle of the point (x, y) from the x axis in [-pi, pi], as std::atan2; absolute error below 6e-7 rad. 0 for (0, 0).
template <class F>
PMSP_HD F atan2(const F& y, const F& x) {
  const F ax = abs(x);
  const F ay = abs(y);
  const F longer = max(ax, ay);
  const F ratio = min(ax, ay) / select(longer > F(0), longer, F(1));
  F angle = kernels::atan_unit(ratio);
  angle = select(ay > ax, F(static_cast<float>(kPi / 2)) - angle, angle);
  angle = select(x < F(0), F(static_cast<float>(kPi)) - angle, angle);
  return select(y < F(0), F(0) - angle, angle);
}

}  // namespace pmsp::kernels
