// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>

namespace pmsp::synth {

/// Mixes 64 bits (finaliser of SplitMix64). Counter-based: draws do not depend on order or threads.
inline std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

inline std::uint64_t mix(std::uint64_t a, std::uint64_t b) { return mix(mix(a) ^ b); }

/// Uniform in [0, 1).
inline double uniform(std::uint64_t seed, std::uint64_t counter) {
  return static_cast<double>(mix(seed, counter) >> 11) * 0x1.0p-53;
}

/// Normal, mean 0, standard deviation 1.
inline double gaussian(std::uint64_t seed, std::uint64_t counter) {
  constexpr double kTwoPi = 6.283185307179586;
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(seed, 2 * counter)));
  return radius * std::cos(kTwoPi * uniform(seed, 2 * counter + 1));
}

}  // namespace pmsp::synth
