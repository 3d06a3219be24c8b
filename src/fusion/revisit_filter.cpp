// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/revisit_filter.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "confidence.h"
#include "cpu/executor_impl.h"
#include "fusion/occupied_cells.h"

namespace pmsp {
namespace {

constexpr int kChunk = 4096;         ///< points that a thread takes at a time
constexpr double kErrors = 4.0;      ///< expected errors (medians) that a point may lie off a surface
constexpr double kMaxReach = 32.0;   ///< cells that are searched on either side at most
constexpr double kSlope = 0.5;       ///< of a slanted surface, the share that counts inside one cell
constexpr double kAlsoFacing = 0.7;  ///< a second axis is tried from this share of the normal's largest component on

/// What a point covers of a surface, in cells of its own size.
struct Footprint {
  Eigen::Vector3d position;  ///< in the world, from the origin [sides of a cell]
  Eigen::Vector3d normal;    ///< world
  double reach;              ///< how far off the surface it may lie, along the normal [sides]
  double depth;              ///< of a cell across the surface [sides]
  int level;
  int axis;  ///< of the world, that the normal is nearest to
};

/// Errors are larger than the spacing: a cell is a quarter of the tolerance deep, which keeps searches short. A power
/// of two, the same for all levels, so that cells nest.
double cell_depth(double tolerance, double spacing) {
  return std::exp2(std::round(std::log2(std::clamp(0.25 * tolerance / spacing, 0.125, 16.0))));
}

/// Wraps far out, at a billion cells.
std::int32_t index_of(double coordinate) {
  return static_cast<std::int32_t>(static_cast<std::int64_t>(std::floor(std::clamp(coordinate, -1e18, 1e18))));
}

SurfaceCell cell_of(const Footprint& print, int axis) {
  return {index_of(print.position[(axis + 1) % 3]), index_of(print.position[(axis + 2) % 3]),
          index_of(print.position[axis] / print.depth), static_cast<std::int8_t>(print.level),
          static_cast<std::uint8_t>(2 * axis + (print.normal[axis] < 0.0 ? 1 : 0))};
}

bool known(const OccupiedCells& cells, const Footprint& print, int axis) {
  SurfaceCell first = cell_of(print, axis);
  const Eigen::Vector3d n = print.normal.cwiseAbs();
  const double slope = kSlope * (n.sum() - n[axis]);
  const double reach = std::min((print.reach + slope) / (print.depth * n[axis]), kMaxReach);
  const double w = print.position[axis] / print.depth;
  first.w = index_of(w - reach);
  return cells.any(first, index_of(w + reach));
}

bool known(const OccupiedCells& cells, const Footprint& print) {
  const Eigen::Vector3d n = print.normal.cwiseAbs();
  const double most = n[print.axis];
  if (!(most > 0.0)) return false;
  for (int i = 0; i < 3; ++i) {
    if ((i == print.axis || n[i] > kAlsoFacing * most) && known(cells, print, i)) return true;
  }
  return false;
}

}  // namespace

struct RevisitFilter::Impl {
  explicit Impl(const FusionOptions& given)
      : options(given), cells(static_cast<std::size_t>(given.revisit_memory_mib) << 20) {}

  Footprint footprint(const CloudPoint& point, const RigidTransform& world_from_cam, double spacing,
                      double cell_depth) const {
    const Eigen::Vector3d ray = point.position.cast<double>();
    const Eigen::Vector3d normal = point.normal.cast<double>();
    const double depth = ray.norm();
    const double error = std::min(kErrors * static_cast<double>(kernels::error_of_confidence(point.confidence)),
                                  options.max_relative_depth);
    Footprint print;
    const double pixel = std::sqrt(depth * std::hypot(ray.x(), ray.z()));  // rows get shorter towards the poles
    print.level = std::ilogb(std::max(spacing * std::max(pixel, 0.01 * depth), 1e-30));
    const double scale = std::ldexp(1.0, -print.level);
    print.position = scale * (world_from_cam * ray);
    print.normal = world_from_cam.rotation * normal;
    print.normal.cwiseAbs().maxCoeff(&print.axis);
    print.depth = cell_depth;
    print.reach = scale * error * std::abs(ray.dot(normal));
    return print;
  }

  FusionOptions options;
  std::optional<Eigen::Vector3d> origin;  ///< where the first cloud was seen from: near it numbers of cells are small
  OccupiedCells cells;
  std::deque<std::vector<SurfaceCell>> recent;  ///< of clouds that share a window with the next one
};

RevisitFilter::RevisitFilter(const FusionOptions& options) {
  options.validate();
  impl_ = std::make_unique<Impl>(options);
}
RevisitFilter::~RevisitFilter() = default;
RevisitFilter::RevisitFilter(RevisitFilter&&) noexcept = default;
RevisitFilter& RevisitFilter::operator=(RevisitFilter&&) noexcept = default;

void RevisitFilter::filter(KeyframeCloud& cloud, int width, const Executor& executor, FilterStats* stats) {
  const std::size_t before = cloud.points.size();
  const FusionOptions& options = impl_->options;
  const double spacing = options.spacing_px * 2.0 * kernels::kPi / width;
  if (options.revisit_memory_mib > 0 && spacing > 0.0) {
    std::vector<SurfaceCell> own(before);
    std::vector<std::uint8_t> kept(before);
    RigidTransform world_from_cam = cloud.cam_from_world.inverse();
    if (!impl_->origin) impl_->origin = world_from_cam.translation;
    world_from_cam.translation -= *impl_->origin;
    const double depth = cell_depth(options.max_relative_depth, spacing);
    const int chunks = static_cast<int>((before + kChunk - 1) / kChunk);
    executor.impl().pool.for_each(chunks, [&](int c) {
      const std::size_t first = static_cast<std::size_t>(c) * kChunk;
      for (std::size_t i = first; i < std::min(before, first + kChunk); ++i) {
        const Footprint print = impl_->footprint(cloud.points[i], world_from_cam, spacing, depth);
        own[i] = cell_of(print, print.axis);
        kept[i] = known(impl_->cells, print) ? 0 : 1;
      }
    });
    std::size_t end = 0;
    for (std::size_t i = 0; i < before; ++i) {
      if (kept[i] == 0) continue;
      cloud.points[end] = cloud.points[i];
      own[end++] = own[i];
    }
    cloud.points.resize(end);
    own.resize(end);
    impl_->recent.push_back(std::move(own));
    if (impl_->recent.size() > static_cast<std::size_t>((options.window - 1) / 2)) {
      impl_->cells.add(std::move(impl_->recent.front()), executor.impl().pool);
      impl_->recent.pop_front();
    }
  }
  if (stats != nullptr) *stats = {static_cast<std::int64_t>(before), static_cast<std::int64_t>(cloud.points.size())};
}

std::size_t RevisitFilter::memory() const { return impl_->cells.bytes(); }

}  // namespace pmsp
