// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include "match.h"
#include "pmsp/options.h"
#include "pmsp/stages.h"

// What the backends' PatchMatch starts from: the kernels' form of the options.
namespace pmsp {

/// Variance of gray levels from which on a patch counts as textured, in an image with this noise (image_noise).
float textured_variance(float noise);

/// The same for what the sky shows: faint clouds, which no surface is near enough to show as one.
float far_variance(float noise);

/// Relative difference of depths from which on disagreement with a neighbour's depth map, or with a prior, is full.
constexpr float kDisagreementTolerance = 0.03F;

/// What agreement with a prior's plane is worth: what texture tells outweighs it.
constexpr kernels::PriorBonus kPriorBonus{0.3F, 1.0F, kDisagreementTolerance};

/// Of each geometric pass: another pass, which looks at newer maps, is worth more than another iteration.
constexpr int kGeometricIterations = 1;

/// `noise`: of the keyframe's image, see image_noise.
kernels::PatchLayout patch_layout(const PatchMatchOptions& options, int width, float noise);
kernels::PlaneLimits plane_limits(const DepthRange& range);
kernels::RandomKey patchmatch_key(std::uint64_t seed, std::int64_t keyframe_id);

/// Those of one pass; they are counted on from pass to pass.
struct Iterations {
  int first;
  int count;
};
Iterations iterations_of(const PatchMatchOptions& options, int pass);

/// All but the views. `noise`: of the reference's image, see image_noise.
template <class Cube>
kernels::Matching<Cube> make_matching(const Cube& reference, float noise, const PatchMatchOptions& options, int width,
                                      const DepthRange& range, std::uint64_t seed, std::int64_t keyframe_id) {
  kernels::Matching<Cube> matching{};
  matching.reference = reference;
  matching.layout = patch_layout(options, width, noise);
  matching.limits = plane_limits(range);
  matching.log_depth_span = static_cast<float>(std::log(range.max / range.min));
  matching.random = patchmatch_key(seed, keyframe_id);
  matching.refinements = options.refinements;
  matching.bonus = kPriorBonus;
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
