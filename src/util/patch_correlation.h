// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace pmsp {

/// Normalises gray values to zero mean and unit length, so that the product of two patches is their correlation.
/// Returns false, with undefined values, if the standard deviation is below `min_deviation` [gray levels].
template <std::size_t N>
bool normalise(std::array<float, N>& patch, float min_deviation) {
  float mean = 0.0F;
  for (const float value : patch) mean += value;
  mean /= static_cast<float>(N);
  float square = 0.0F;
  for (float& value : patch) {
    value -= mean;
    square += value * value;
  }
  if (square < min_deviation * min_deviation * static_cast<float>(N)) return false;
  const float scale = 1.0F / std::sqrt(square);
  for (float& value : patch) value *= scale;
  return true;
}

/// Returns the correlation of normalised patches, -1 to 1.
template <std::size_t N>
float correlation(const std::array<float, N>& a, const std::array<float, N>& b) {
  float sum = 0.0F;
  for (std::size_t i = 0; i < N; ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace pmsp
