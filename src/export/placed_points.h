// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "pmsp/io/cloud_writer.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Places clouds by several threads, piece by piece: one of a large keyframe would take half as much memory again.
class PlacedPoints {
 public:
  explicit PlacedPoints(int threads);

  /// Of the `count` points that `place` makes. `take` may change the points, which are gone after it.
  void for_each_piece(std::size_t count, const PlacePoints& place,
                      const std::function<void(OutputPoint* points, std::size_t count)>& take);

 private:
  static constexpr std::size_t kShare = std::size_t{1} << 14;
  static constexpr std::size_t kPiece = 8 * kShare;

  ThreadPool pool_;
  std::vector<OutputPoint> piece_;
};

}  // namespace pmsp
