// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <xsimd/xsimd.hpp>

#include "num.h"

// xsimd's batches as the number type of the kernels.
namespace pmsp::kernels {

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
  static PMSP_HD F gather(const float* data, const Int& index) { return F::gather(data, index); }
  static PMSP_HD UInt gather(const std::uint32_t* data, const Int& index) { return UInt::gather(data, index); }
  static PMSP_HD F pow2(const Int& exponent) { return xsimd::bitwise_cast<F>(Int(exponent + Int(127)) << 23); }
};

}  // namespace pmsp::kernels
