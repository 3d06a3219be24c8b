// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include "match.h"
#include "pmsp/options.h"
#include "pmsp/stages.h"

// Input of PatchMatch, for all backends: the options in the format of the kernels.
namespace pmsp {

/// Minimum variance of gray levels of a textured patch, in an image with this noise (image_noise).
float textured_variance(float noise);

/// Minimum variance for evidence of far planes: lower, so that low-contrast clouds suffice.
float far_variance(float noise);

/// Relative depth difference of full disagreement with a source view's depth map, or with a prior.
constexpr float kDisagreementTolerance = 0.03F;

/// Bonus for agreement with a prior plane; texture outweighs it.
constexpr kernels::PriorBonus kPriorBonus{0.3F, 1.0F, kDisagreementTolerance};

/// Iterations of a geometric pass.
constexpr int kGeometricIterations = 1;

/// `noise`: of the keyframe's image, see image_noise.
kernels::PatchParams patch_params(const PatchMatchOptions& options, int width, float noise);
kernels::PlaneLimits plane_limits(const DepthRange& range);
kernels::RandomKey patchmatch_key(std::uint64_t seed, std::int64_t keyframe_id);

/// Iterations of one pass, numbered across passes.
struct Iterations {
  int first;
  int count;
};
Iterations iterations_of(const PatchMatchOptions& options, int pass);

/// Input of a pass, without the views. `noise`: of the reference image, see image_noise.
template <class Cube>
kernels::MatchArgs<Cube> make_match_args(const Cube& reference, float noise, const PatchMatchOptions& options,
                                         int width, const DepthRange& range, std::uint64_t seed,
                                         std::int64_t keyframe_id) {
  kernels::MatchArgs<Cube> match_args{};
  match_args.reference = reference;
  match_args.params = patch_params(options, width, noise);
  match_args.limits = plane_limits(range);
  match_args.log_depth_span = static_cast<float>(std::log(range.max / range.min));
  match_args.random = patchmatch_key(seed, keyframe_id);
  match_args.refinements = options.refinements;
  match_args.bonus = kPriorBonus;
  return match_args;
}

/// Propagation and refinement of both colours, for all iterations of a pass. `rescore`: scores are
/// from the previous pass, with other depth maps and priors: recompute them. Returns early once `cancelled()`.
template <class Processor, class Pass, class Cancelled>
void run_iterations(Processor& on, const Pass& pass, const Iterations& iterations, bool rescore,
                    const Cancelled& cancelled) {
  for (int i = 0; i < iterations.count; ++i) {
    for (int colour = 0; colour < 2; ++colour) {
      if (cancelled()) return;
      on.iterate(pass, colour, iterations.first + i, rescore && i == 0);
    }
  }
}

}  // namespace pmsp
