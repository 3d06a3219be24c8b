// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace pmsp::eval {

/// Nearest-neighbour search in a set of points. Thread-safe.
class NearestPoint {
 public:
  /// Keeps a reference to `points`, which must stay unchanged, be finite and fewer than 2^32.
  explicit NearestPoint(const std::vector<Eigen::Vector3f>& points);
  ~NearestPoint();

  struct Hit {
    std::uint32_t index = 0;
    float distance = 0.0F;
  };

  /// Returns nullopt if no point is nearer than `max_distance`.
  std::optional<Hit> find(const Eigen::Vector3f& point,
                          float max_distance = std::numeric_limits<float>::infinity()) const;

  /// Returns the `count` nearest points, or all if they are fewer, by distance.
  std::vector<Hit> find_several(const Eigen::Vector3f& point, std::size_t count) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp::eval
