// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "pmsp/io/cloud.h"
#include "util/thread_pool.h"

namespace pmsp {

/// A keyframe's points in the frame of a file.
class PointPlacer {
 public:
  /// `cloud` must outlive it.
  PointPlacer(const KeyframeCloud& cloud, const KeyframePose& pose, const Similarity& file_from_map);

  std::size_t size() const { return cloud_.points.size(); }
  Eigen::Vector3d position(std::size_t i) const;
  void place(std::size_t i, OutputPoint& to) const;

 private:
  const KeyframeCloud& cloud_;
  double scale_;
  RigidTransform map_from_cam_;
  Similarity file_from_map_;
  bool moves_;
  Eigen::Matrix3f rotation_;  ///< of normals
};

/// Numbers of the points that lie in a box, ascending.
std::vector<std::uint32_t> points_in_box(const PointPlacer& points, const Box& box, ThreadPool& pool);

/// Places clouds by several threads, piece by piece: one of a large keyframe would take half as much memory again.
class PlacedPoints {
 public:
  explicit PlacedPoints(ThreadPool& pool);

  /// Of the `count` points that `place` makes. They are gone after `take`.
  void for_each_piece(std::size_t count, const PlacePoints& place,
                      const std::function<void(const OutputPoint* points, std::size_t count)>& take);

 private:
  ThreadPool& pool_;
  std::vector<OutputPoint> piece_;
};

}  // namespace pmsp
