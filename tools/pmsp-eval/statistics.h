// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace pmsp::eval {

/// Percentile (0 to 100) with linear interpolation between ranks; reorders `values`. NaN if empty.
template <class T>
double percentile(std::vector<T>& values, double percent) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double rank = percent / 100.0 * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(rank);
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(below);
  std::nth_element(values.begin(), nth, values.end());
  const double low = static_cast<double>(*nth);
  if (below + 1 >= values.size()) return low;
  const double high = static_cast<double>(*std::min_element(nth + 1, values.end()));
  return low + (rank - static_cast<double>(below)) * (high - low);
}

/// Mean of `value(item)`, without undefined ones (NaN); NaN if none is left.
template <class Item, class Value>
double mean_without_nan(const std::vector<Item>& items, const Value& value) {
  double sum = 0.0;
  int count = 0;
  for (const Item& item : items) {
    const double v = value(item);
    if (std::isnan(v)) continue;
    sum += v;
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

/// Returns `count` indices, ascending and evenly spread over [0, size), including both ends; all for count 0 or >=
/// size.
inline std::vector<std::size_t> spread_indices(std::size_t size, std::size_t count) {
  std::vector<std::size_t> indices;
  if (count == 0 || count >= size) count = size;
  for (std::size_t i = 0; i < count; ++i) {
    indices.push_back(count == 1 ? size / 2 : (i * (size - 1) + (count - 1) / 2) / (count - 1));
  }
  return indices;
}

}  // namespace pmsp::eval
