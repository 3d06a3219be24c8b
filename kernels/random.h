// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "num.h"

// Counter-based random numbers: a draw is a pure function of (seed, keyframe, stage, pixel, draw), independent of the
// number of threads, the order of work and the backend.
namespace pmsp::kernels {

/// Bijective mix of 32 bits: two rounds of multiply and xor-shift. Constants: Chris Wellons, "Prospecting for Hash
/// Functions" (2018), the variant with the lowest known bias.
template <class U>
PMSP_HD U mix(U x) {
  x ^= x >> 16;
  x *= U(0x7feb352dU);
  x ^= x >> 15;
  x *= U(0x846ca68bU);
  x ^= x >> 16;
  return x;
}

/// Key of one stage of one keyframe.
struct RandomKey {
  std::uint32_t a;
  std::uint32_t b;
};

PMSP_HD RandomKey random_key(std::uint64_t seed, std::uint64_t keyframe, std::uint32_t stage) {
  const std::uint32_t low = static_cast<std::uint32_t>(seed) ^ mix(static_cast<std::uint32_t>(keyframe) + 0x9e3779b9U);
  const std::uint32_t high = static_cast<std::uint32_t>(seed >> 32U) + mix(static_cast<std::uint32_t>(keyframe >> 32U));
  return {mix(low + mix(stage + 0x85ebca6bU)), mix(high ^ mix(low ^ 0xc2b2ae35U))};
}

/// Uniform in [0, 1), a multiple of 2^-24: draw number `draw` of pixel `pixel`.
template <class F>
PMSP_HD F uniform(const RandomKey& key, const UIntOf<F>& pixel, std::uint32_t draw) {
  using U = UIntOf<F>;
  const U bits = mix(U(mix(U(pixel ^ U(key.a))) + U(mix(draw + key.b))));
  return from_uint<F>(U(bits >> 8)) * F(5.9604644775390625e-8F);
}

/// Uniform in [-1, 1).
template <class F>
PMSP_HD F uniform_signed(const RandomKey& key, const UIntOf<F>& pixel, std::uint32_t draw) {
  return fma(F(2), uniform<F>(key, pixel, draw), F(-1));
}

}  // namespace pmsp::kernels
