// SPDX-License-Identifier: BSD-2-Clause
#include "patchmatch/match_setup.h"

#include <algorithm>
#include <cmath>

#include "elementary.h"

namespace pmsp {
namespace {

/// Stages of a keyframe that draw random numbers.
constexpr std::uint32_t kPatchMatchStage = 1;

/// Variance of gray levels that rounding to bytes makes (1 / 12). Patches that vary no more than that score low. More
/// would cost plaster and bare roofs their depth: noise of the camera itself is averaged away by the resampling.
constexpr float kNoiseVariance = 0.1F;

}  // namespace

kernels::PatchLayout patch_layout(const PatchMatchOptions& options, int width) {
  kernels::PatchLayout layout{};
  const auto spacing = [&](double pixels) { return static_cast<float>(std::tan(pixels * 2.0 * kernels::kPi / width)); };
  layout.spacing = spacing(options.patch_spacing_px);
  layout.fine_spacing = spacing(options.patch_spacing_px * options.fine_patch);
  const double contrast = options.fine_patch_contrast;
  layout.fine_variance = options.fine_patch < 1.0 ? static_cast<float>(contrast * contrast) : -1.0F;
  layout.min_sigma_color = static_cast<float>(std::min(options.min_sigma_color, options.sigma_color));
  layout.max_sigma_color = static_cast<float>(options.sigma_color);
  layout.min_variance = kNoiseVariance;
  layout.disagreement_cost = static_cast<float>(options.geometric_weight);
  layout.disagreement_tolerance = static_cast<float>(options.geometric_tolerance);
  const auto weigh = [](float* weights, double steps) {
    for (int k = 0; k < kernels::kPatchSamples; ++k) {
      const double dx = kernels::patch_offset(k % kernels::kPatchSide);
      const double dy = kernels::patch_offset(k / kernels::kPatchSide);
      weights[k] = static_cast<float>(std::exp(-0.5 * (dx * dx + dy * dy) / (steps * steps)));
    }
  };
  weigh(layout.space_weight, options.sigma_space_px / options.patch_spacing_px);
  weigh(layout.fine_space_weight, options.fine_sigma_space_px / (options.patch_spacing_px * options.fine_patch));
  return layout;
}

kernels::PlaneLimits plane_limits(const PatchMatchOptions& options, const DepthRange& range) {
  const double min_cos = std::cos(options.max_slant_deg * kernels::kPi / 180.0);
  return {static_cast<float>(1.0 / range.max), static_cast<float>(1.0 / range.min),
          static_cast<float>(min_cos * min_cos)};
}

kernels::RandomKey patchmatch_key(std::uint64_t seed, std::int64_t keyframe_id) {
  return kernels::random_key(seed, static_cast<std::uint64_t>(keyframe_id), kPatchMatchStage);
}

Iterations iterations_of(const PatchMatchOptions& options, int pass) {
  if (pass == 0) return {0, options.iterations};
  return {options.iterations + (pass - 1) * options.geometric_iterations, options.geometric_iterations};
}

}  // namespace pmsp
