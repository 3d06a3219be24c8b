// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <memory>

#include "pmsp/executor.h"
#include "pmsp/filters.h"
#include "pmsp/options.h"
#include "pmsp/point_cloud.h"

namespace pmsp {

/// Leaves out points of places that were passed before: fusion joins only the depth maps of its window. Remembers the
/// surfaces of all clouds that went through it, within bounds.
///
/// A point goes when an earlier cloud, from outside its own fusion window, has one beside it on the same surface:
/// within about `spacing_px` of its own pixels along the surface; across it within a few times the error that its
/// confidence stands for, at most `max_relative_depth`; with a normal of about the same direction, so that both sides
/// of a thin wall stay. Points that sample a surface more closely than what is there are kept; those that do so as
/// closely or more coarsely go.
///
/// Surfaces are remembered as cells whose size follows the spacing of the points by powers of two; 4 x 4 x 4 of them
/// take 16 bytes, which is a good ten bytes a point. When `revisit_memory_mib` is full, the older half is forgotten.
class RevisitFilter {
 public:
  /// Throws InvalidOption.
  explicit RevisitFilter(const FusionOptions& options);
  ~RevisitFilter();
  RevisitFilter(RevisitFilter&&) noexcept;
  RevisitFilter& operator=(RevisitFilter&&) noexcept;

  /// Clouds come in the order of their keyframes, with final poses. `width`: of the depth maps that the cloud was made
  /// of [px].
  void filter(KeyframeCloud& cloud, int width, const Executor& executor, FilterStats* stats = nullptr);

  /// What is allocated for what is remembered [bytes]; at most `revisit_memory_mib`. The points of half a fusion window
  /// come on top, 16 bytes each.
  std::size_t memory() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
