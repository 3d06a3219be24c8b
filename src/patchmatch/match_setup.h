// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include "patchmatch.h"
#include "pmsp/initialiser.h"
#include "pmsp/options.h"

// What the backends' PatchMatch starts from: the kernels' form of the options.
namespace pmsp {

kernels::PatchLayout patch_layout(const PatchMatchOptions& options, int width);
kernels::PlaneLimits plane_limits(const PatchMatchOptions& options, const DepthRange& range);
kernels::RandomKey patchmatch_key(std::uint64_t seed, std::int64_t keyframe_id);

/// Those of one pass; they are counted on from pass to pass.
struct Iterations {
  int first;
  int count;
};
Iterations iterations_of(const PatchMatchOptions& options, int pass);

/// All but the views.
template <class Cube>
kernels::Matching<Cube> make_matching(const Cube& reference, const PatchMatchOptions& options, int width,
                                      const DepthRange& range, std::uint64_t seed, std::int64_t keyframe_id) {
  kernels::Matching<Cube> matching{};
  matching.reference = reference;
  matching.layout = patch_layout(options, width);
  matching.limits = plane_limits(options, range);
  matching.log_depth_span = static_cast<float>(std::log(range.max / range.min));
  matching.random = patchmatch_key(seed, keyframe_id);
  matching.refinements = options.refinements;
  matching.prior_weight = static_cast<float>(options.prior_weight);
  return matching;
}

/// Propagation and refinement of both colours, as often as a pass wants. `started`: planes are there, but not their
/// scores. Returns early once `cancelled()`.
template <class Processor, class Pass, class Cancelled>
void run_iterations(Processor& on, const Pass& pass, const Iterations& iterations, bool started,
                    const Cancelled& cancelled) {
  for (int i = 0; i < iterations.count; ++i) {
    for (int colour = 0; colour < 2; ++colour) {
      if (cancelled()) return;
      on.iterate(pass, colour, iterations.first + i, started && i == 0);
    }
  }
}

}  // namespace pmsp
