// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "num.h"

namespace pmsp::kernels {

template <class F>
PMSP_HD void order(F& a, F& b) {
  const F low = min(a, b);
  b = max(a, b);
  a = low;
}

/// Median of nine values, by the 19 exchanges of the smallest known network (Paeth 1990). Changes `v`.
template <class F>
PMSP_HD F median9(F* v) {
  order(v[1], v[2]);
  order(v[4], v[5]);
  order(v[7], v[8]);
  order(v[0], v[1]);
  order(v[3], v[4]);
  order(v[6], v[7]);
  order(v[1], v[2]);
  order(v[4], v[5]);
  order(v[7], v[8]);
  order(v[0], v[3]);
  order(v[5], v[8]);
  order(v[4], v[7]);
  order(v[3], v[6]);
  order(v[1], v[4]);
  order(v[2], v[5]);
  order(v[4], v[7]);
  order(v[4], v[2]);
  order(v[6], v[4]);
  order(v[4], v[2]);
  return v[4];
}

/// The depth if it lies close to the median of its neighbourhood and its score is good enough, else 0. `around`: the 3
/// x 3 depths, the pixel's own in the middle; those without an estimate (0) count as the pixel's own. Changes `around`.
template <class F>
PMSP_HD F median_filtered(F* around, const F& score, const F& max_relative_deviation, const F& min_score) {
  const F depth = around[4];
  for (int i = 0; i < 9; ++i) around[i] = select(around[i] > F(0), around[i], depth);
  const F median = median9(around);
  const auto kept = (abs(depth - median) <= max_relative_deviation * median) & (score >= min_score);
  return select(kept, depth, F(0));
}

}  // namespace pmsp::kernels
