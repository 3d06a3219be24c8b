// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "equirect.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"
#include "sphere/grid.h"
#include "util/eigen_kernels.h"
#include "util/inside.h"
#include "util/plane_fit.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

constexpr int kReach = 2;                 ///< samples on either side of a pixel
constexpr double kSamplesAround = 640.0;  ///< samples per circle
constexpr int kMinSamples = 6;            ///< minimum number on one surface
constexpr double kSurface = 0.1;          ///< maximum relative deviation of the inverse depth on one surface
constexpr double kOnPlane = 0.03;         ///< maximum relative deviation from a first plane
constexpr double kSteadiness = 1e-8;
constexpr double kLeastCosine = 0.17;  ///< minimum cosine of normal and ray; about 80 degrees

struct Sample {
  Eigen::Vector3d bearing;
  double inverse_depth;
};

class NormalsOfDepth {
 public:
  explicit NormalsOfDepth(const Image<float>& depth) : depth_(depth), grid_(depth.width(), depth.height()) {
    step_ = std::max(1, static_cast<int>(std::lround(depth.width() / kSamplesAround)));
    for (int y = 0; y < depth.height(); ++y) {  // as far apart on the sphere as rows are
      const double cosine = std::cos(kernels::kPi * ((y + 0.5) / depth.height() - 0.5));
      columns_.push_back(std::clamp(static_cast<int>(std::lround(step_ / cosine)), 1, std::max(1, depth.width() / 8)));
    }
  }

  Eigen::Vector3f at(int x, int y) const {
    const double own = depth_at(x, y);
    if (own == 0.0) return Eigen::Vector3f::Zero();
    const Eigen::Vector3d ray = bearing(x, y);
    Samples samples;
    const std::size_t count = collect(x, y, 1.0 / own, samples);
    Eigen::Vector3d plane = ray / own;           // if there are too few samples
    for (const bool is_first : {true, false}) {  // first all samples: slanted surfaces deviate from the initial plane
      PlaneFit fit;
      for (std::size_t i = 0; i < count; ++i) {
        const double there = plane.dot(samples[i].bearing);
        if (!is_first && std::abs(samples[i].inverse_depth - there) > kOnPlane * there) continue;
        fit.add(samples[i].bearing, samples[i].inverse_depth);
      }
      Eigen::Vector3d fitted;
      if (fit.count() < kMinSamples || !fit.solve(kSteadiness, fitted) || !(fitted.dot(ray) > 0.0)) break;
      plane = fitted;
    }
    return limited(-plane.normalized(), ray).cast<float>();
  }

 private:
  using Samples = std::array<Sample, (2 * kReach + 1) * (2 * kReach + 1)>;

  Eigen::Vector3d bearing(int x, int y) const {
    const kernels::GridView grid = grid_.view();
    return to_eigen(kernels::bearing(grid.sin_lon[x], grid.cos_lon[x], grid.sin_lat[y], grid.cos_lat[y]))
        .cast<double>();
  }
  double depth_at(int x, int y) const {
    const double depth = static_cast<double>(depth_(x, y));
    return is_usable_depth(depth) ? depth : 0.0;
  }

  /// Samples on the pixel's side of depth edges.
  std::size_t collect(int x, int y, double own, Samples& samples) const {
    const int width = depth_.width();
    std::size_t count = 0;
    for (int dy = -kReach; dy <= kReach; ++dy) {
      const int row = y + dy * step_;
      if (row < 0 || row >= depth_.height()) continue;
      for (int dx = -kReach; dx <= kReach; ++dx) {
        const int column = ((x + dx * columns_[static_cast<std::size_t>(row)]) % width + width) % width;
        const double depth = depth_at(column, row);
        if (depth == 0.0 || std::abs(1.0 / depth - own) > kSurface * own) continue;
        samples[count++] = {bearing(column, row), 1.0 / depth};
      }
    }
    return count;
  }

  /// The normal, tilted to the maximum slant if beyond.
  static Eigen::Vector3d limited(const Eigen::Vector3d& normal, const Eigen::Vector3d& ray) {
    const double cosine = -normal.dot(ray);
    if (cosine >= kLeastCosine) return normal;
    const Eigen::Vector3d across = (normal + cosine * ray).normalized();
    return std::sqrt(1.0 - kLeastCosine * kLeastCosine) * across - kLeastCosine * ray;
  }

  const Image<float>& depth_;
  SphereGrid grid_;
  int step_ = 1;              ///< rows between samples
  std::vector<int> columns_;  ///< columns between samples, in each row
};

}  // namespace

Image<Eigen::Vector3f> estimate_normals(const Image<float>& depth, const Executor& executor) {
  Image<Eigen::Vector3f> normals(depth.width(), depth.height(), Eigen::Vector3f::Zero());
  if (depth.empty()) return normals;
  const NormalsOfDepth normals_of(depth);
  pool_of(executor).for_each(depth.height(), [&](int y) {
    for (int x = 0; x < depth.width(); ++x) normals(x, y) = normals_of.at(x, y);
  });
  return normals;
}

}  // namespace pmsp
