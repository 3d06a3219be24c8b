// SPDX-License-Identifier: BSD-2-Clause
#include "framing.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pmsp::tool {
namespace {

constexpr int kOutermost = 1;  ///< percent dropped at either end in any case
constexpr int kInnermost = 45;
constexpr double kWorth = 8.0;
constexpr std::size_t kMostDistances = 2'000, kMostPlaces = 500;  ///< for pairwise distances

std::size_t stride_for(std::size_t count, std::size_t most) { return std::max<std::size_t>(1, count / most); }

/// Coordinates of the points that are inside the box on the other axes.
std::vector<double> coordinates(const std::vector<Eigen::Vector3d>& points, int axis, const FramedBox& box) {
  std::vector<double> values;
  for (const Eigen::Vector3d& point : points) {
    bool is_in = true;
    for (int other = 0; other < 3; ++other) {
      is_in = is_in && (other == axis || (point[other] >= box.low[other] && point[other] <= box.high[other]));
    }
    if (is_in) values.push_back(point[axis]);
  }
  return values;
}

/// Median distance of the points from the path, which is not empty.
double usual_distance(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& path) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < points.size(); i += stride_for(points.size(), kMostDistances)) {
    double nearest = std::numeric_limits<double>::max();
    for (std::size_t k = 0; k < path.size(); k += stride_for(path.size(), kMostPlaces)) {
      nearest = std::min(nearest, (points[i] - path[k]).norm());
    }
    distances.push_back(nearest);
  }
  std::sort(distances.begin(), distances.end());
  return distances[distances.size() / 2];
}

}  // namespace

Interval framing_interval(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&values](int percent) {
    return values[static_cast<std::size_t>(percent) * (values.size() - 1) / 100];
  };
  Interval best{at(kOutermost), at(100 - kOutermost)};
  const double least = 1e-6 * (best.high - best.low);  // guards against equal values
  if (!(least > 0.0)) return best;
  double lowest = std::numeric_limits<double>::max();
  for (int low = kOutermost; low <= kInnermost; ++low) {
    for (int high = 100 - kOutermost; high >= 100 - kInnermost; --high) {
      const double length = std::max(at(high) - at(low), least);
      const double cost = std::log(length) - kWorth * std::log(0.01 * (high - low));
      if (cost >= lowest) continue;
      lowest = cost;
      best = {at(low), at(high)};
    }
  }
  return best;
}

FramedBox framing_box(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& path) {
  if (points.empty()) return {};
  constexpr double kAll = std::numeric_limits<double>::max();
  FramedBox box{Eigen::Vector3d::Constant(-kAll), Eigen::Vector3d::Constant(kAll)};
  for (int round = 0; round < 2; ++round) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::vector<double> values = coordinates(points, axis, box);
      if (values.empty()) continue;
      const Interval stretch = framing_interval(values);
      box.low[axis] = stretch.low;
      box.high[axis] = stretch.high;
    }
  }
  if (path.empty()) return box;
  FramedBox around{path.front(), path.front()};
  for (const Eigen::Vector3d& place : path) {
    around.low = around.low.cwiseMin(place);
    around.high = around.high.cwiseMax(place);
  }
  box.low = box.low.cwiseMin(around.low);
  box.high = box.high.cwiseMax(around.high);
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(usual_distance(points, path));
  const Eigen::Vector3d low = around.low - reach, high = around.high + reach;
  for (const Eigen::Vector3d& point : points) {
    if ((point.array() < low.array()).any() || (point.array() > high.array()).any()) continue;
    box.low = box.low.cwiseMin(point);
    box.high = box.high.cwiseMax(point);
  }
  return box;
}

}  // namespace pmsp::tool
