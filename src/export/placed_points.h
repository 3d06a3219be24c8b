// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "pmsp/io/cloud.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Points of a keyframe, transformed to the frame of a file.
class PointTransform {
 public:
  /// `cloud` must outlive it.
  PointTransform(const KeyframeCloud& cloud, const KeyframePose& pose, const Similarity& file_from_map);

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

/// Returns the indices of the points in a box, ascending.
std::vector<std::uint32_t> points_in_box(const PointTransform& points, const Box& box, ThreadPool& pool);

/// Transforms clouds with several threads, in pieces to bound memory.
class PointChunks {
 public:
  explicit PointChunks(ThreadPool& pool);

  /// Calls `take` for each piece of the `count` points of `place`; the piece is valid during the call.
  void for_each_piece(std::size_t count, const PointProducer& place,
                      const std::function<void(const OutputPoint* points, std::size_t count)>& take);

 private:
  ThreadPool& pool_;
  std::vector<OutputPoint> piece_;
};

}  // namespace pmsp
