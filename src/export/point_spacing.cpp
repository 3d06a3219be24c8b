// SPDX-License-Identifier: BSD-2-Clause
#include "export/point_spacing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "elementary.h"
#include "export/point_tree.h"

namespace pmsp {
namespace {

constexpr std::size_t kNearest = 8;           ///< beside the point itself
constexpr std::size_t kPointsPerTask = 4096;  ///< points per task

using Neighbours = std::array<std::uint32_t, kNearest + 1>;

template <class Body>
void each_share(std::size_t count, ThreadPool& pool, const Body& body) {
  pool.for_each(static_cast<int>((count + kPointsPerTask - 1) / kPointsPerTask), [&](int share) {
    const std::size_t first = static_cast<std::size_t>(share) * kPointsPerTask;
    for (std::size_t i = first; i < std::min(first + kPointsPerTask, count); ++i) body(i);
  });
}

}  // namespace

std::vector<float> point_spacing(const std::vector<Eigen::Vector3f>& positions, ThreadPool& pool) {
  const std::size_t count = positions.size(), wanted = std::min(kNearest + 1, count);
  std::vector<float> spacing(count, 0.0F);
  if (count < 2) return spacing;
  const PointSet set{positions};
  const PointTree tree(3, set, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  std::vector<Neighbours> neighbours(count);
  each_share(count, pool, [&](std::size_t i) {
    std::array<float, kNearest + 1> squared{};
    tree.knnSearch(positions[i].data(), wanted, neighbours[i].data(), squared.data());
    const float disc = static_cast<float>(kernels::kPi) * squared[wanted - 1];
    spacing[i] = std::sqrt(disc / static_cast<float>(wanted - 1));
  });
  std::vector<float> limited(count);
  each_share(count, pool, [&](std::size_t i) {
    std::array<float, kNearest + 1> around{};
    for (std::size_t k = 0; k < wanted; ++k) around[k] = spacing[neighbours[i][k]];
    std::nth_element(around.begin(), around.begin() + wanted / 2, around.begin() + wanted);
    limited[i] = std::min(spacing[i], 2.0F * around[wanted / 2]);
  });
  std::vector<float> sorted = limited;
  const auto high = sorted.begin() + static_cast<std::ptrdiff_t>(count - 1 - count / 100);
  std::nth_element(sorted.begin(), high, sorted.end());
  const float most = 4.0F * *high;
  for (float& value : limited) value = std::min(value, most);
  return limited;
}

}  // namespace pmsp
