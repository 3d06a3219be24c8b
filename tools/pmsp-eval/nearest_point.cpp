// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/nearest_point.h"

#include <algorithm>
#include <cmath>

#include "export/point_tree.h"

namespace pmsp::eval {
namespace {

/// nanoflann's result set for one neighbour inside a given radius.
// NOLINTBEGIN(readability-identifier-naming): names required by nanoflann
class NearestOne {
 public:
  using DistanceType = float;
  using IndexType = std::uint32_t;

  explicit NearestOne(float max_squared) : squared_(max_squared) {}
  bool full() const { return true; }
  std::size_t size() const { return found_ ? 1 : 0; }
  float worstDist() const { return squared_; }
  bool addPoint(float squared, std::uint32_t index) {
    if (squared < squared_) {
      squared_ = squared;
      index_ = index;
      found_ = true;
    }
    return true;
  }

  void sort() {}

  bool found() const { return found_; }
  std::uint32_t index() const { return index_; }

 private:
  float squared_;
  std::uint32_t index_ = 0;
  bool found_ = false;
};
// NOLINTEND(readability-identifier-naming)

constexpr std::size_t kLeafSize = 16;

}  // namespace

struct NearestPoint::Impl {
  explicit Impl(const std::vector<Eigen::Vector3f>& points)
      : set{points}, tree(3, set, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize)) {}

  PointSet set;
  PointTree tree;
};

NearestPoint::NearestPoint(const std::vector<Eigen::Vector3f>& points) : impl_(std::make_unique<Impl>(points)) {}
NearestPoint::~NearestPoint() = default;

std::optional<NearestPoint::Hit> NearestPoint::find(const Eigen::Vector3f& point, float max_distance) const {
  if (impl_->set.points.empty()) return std::nullopt;
  NearestOne best(max_distance * max_distance);
  impl_->tree.findNeighbors(best, point.data(), {});
  if (!best.found()) return std::nullopt;
  return Hit{best.index(), std::sqrt(best.worstDist())};
}

std::vector<NearestPoint::Hit> NearestPoint::find_several(const Eigen::Vector3f& point, std::size_t count) const {
  count = std::min(count, impl_->set.points.size());
  std::vector<std::uint32_t> indices(count);
  std::vector<float> squared(count);
  if (count > 0) impl_->tree.knnSearch(point.data(), count, indices.data(), squared.data());
  std::vector<Hit> hits(count);
  for (std::size_t i = 0; i < count; ++i) hits[i] = {indices[i], std::sqrt(squared[i])};
  return hits;
}

}  // namespace pmsp::eval
