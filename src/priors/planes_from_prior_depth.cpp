// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "pmsp/camera.h"
#include "pmsp/stages.h"
#include "priors/nearest_value.h"
#include "priors/prior_setup.h"
#include "util/median_of.h"
#include "util/plane_fit.h"

namespace pmsp {
namespace {

constexpr int kWindowSide = 9;          ///< samples along each side of the window around a cell
constexpr double kWindow = 3.0;         ///< side of the window [cells]
constexpr int kMinWindowSamples = 20;   ///< minimum number on one surface
constexpr double kWindowSurface = 0.2;  ///< maximum relative distance of one surface from the cell's own inverse depth
constexpr double kOnWindowPlane = 0.1;  ///< maximum relative distance from a first plane
constexpr double kWindowSteadiness = 1e-4;  ///< against rotation if samples are collinear; relative to their spread

struct WindowSample {
  Eigen::Vector3d bearing;
  double inverse_depth;
};

/// Least-squares plane v with v . bearing = inverse depth, of the samples within the relative `tolerance` of
/// `expected(bearing)`. Returns false if these are too few.
template <class Expected>
bool fit(const std::vector<WindowSample>& samples, double tolerance, const Expected& expected, Eigen::Vector3d& plane) {
  PlaneFit on_surface;
  for (const WindowSample& sample : samples) {
    const double there = expected(sample.bearing);
    if (std::abs(sample.inverse_depth - there) < tolerance * there)
      on_surface.add(sample.bearing, sample.inverse_depth);
  }
  return on_surface.count() >= kMinWindowSamples && on_surface.solve(kWindowSteadiness, plane);
}

}  // namespace

std::vector<kernels::Vec3<float>> planes_from_prior_depth(ImageView<const float> depth, double unit,
                                                          const PriorGrid& grid) {
  std::vector<kernels::Vec3<float>> planes(grid.cells(), kernels::Vec3<float>{0.0F, 0.0F, 0.0F});
  const double step = kernels::kPi / grid.rows * kWindow / kWindowSide;
  std::vector<WindowSample> samples;
  std::vector<double> own;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const Eigen::Vector3d center = bearing_from_pixel({column + 0.5, row + 0.5}, grid.columns, grid.rows);
      const Eigen::Vector3d right = Eigen::Vector3d(center.z(), 0.0, -center.x()).normalized();
      const Eigen::Vector3d down = center.cross(right);
      samples.clear();
      own.clear();
      for (int i = 0; i < kWindowSide * kWindowSide; ++i) {
        const int dx = i % kWindowSide - kWindowSide / 2, dy = i / kWindowSide - kWindowSide / 2;
        const Eigen::Vector3d bearing = (center + step * dx * right + step * dy * down).normalized();
        const double there = nearest_value(depth, bearing) / unit;
        if (!is_usable_depth(there)) continue;
        samples.push_back({bearing, 1.0 / there});
        if (std::max(std::abs(dx), std::abs(dy)) <= kWindowSide / 6) own.push_back(1.0 / there);
      }
      if (own.empty()) continue;
      const double middle = median(own);
      Eigen::Vector3d plane;
      if (!fit(
              samples, kWindowSurface, [&](const Eigen::Vector3d&) { return middle; }, plane))
        continue;
      const Eigen::Vector3d first = plane;
      if (!fit(
              samples, kOnWindowPlane, [&](const Eigen::Vector3d& bearing) { return first.dot(bearing); }, plane))
        continue;
      const Eigen::Vector3f found = plane.cast<float>();
      planes[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) +
             static_cast<std::size_t>(column)] = {found.x(), found.y(), found.z()};
    }
  }
  return planes;
}

}  // namespace pmsp
