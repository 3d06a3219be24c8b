// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

namespace pmsp {

/// Which keyframes each stage has been at, whatever the order.
class Progress {
 public:
  explicit Progress(std::size_t stages) : next_(stages, 0), beyond_(stages) {}

  /// The first keyframe that the stage has not been at.
  std::int64_t next(std::size_t stage) const { return next_[stage]; }

  bool done(std::size_t stage, std::int64_t keyframe) const {
    return keyframe < next_[stage] || beyond_[stage].count(keyframe) != 0;
  }

  void mark(std::size_t stage, std::int64_t keyframe) {
    std::set<std::int64_t>& beyond = beyond_[stage];
    beyond.insert(keyframe);
    for (; !beyond.empty() && *beyond.begin() == next_[stage]; ++next_[stage]) beyond.erase(beyond.begin());
  }

 private:
  std::vector<std::int64_t> next_;
  std::vector<std::set<std::int64_t>> beyond_;  ///< those after `next_` that it has been at
};

}  // namespace pmsp
