// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

namespace pmsp {

/// Completed keyframes of each stage, in any order.
class Progress {
 public:
  explicit Progress(std::size_t stages) : next_(stages, 0), beyond_(stages) {}

  /// Returns the first keyframe not completed by the stage.
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
  std::vector<std::set<std::int64_t>> beyond_;  ///< completed keyframes after `next_`
};

}  // namespace pmsp
