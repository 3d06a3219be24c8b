// SPDX-License-Identifier: BSD-2-Clause
#include "patchmatch/match_setup.h"

#include <algorithm>
#include <cmath>

#include "cost.h"
#include "elementary.h"

namespace pmsp {
namespace {

/// Stages of a keyframe that draw random numbers.
constexpr std::uint32_t kPatchMatchStage = 1;

/// Noise variance of gray levels, about that of rounding to 8 bits (1 / 12). Larger values remove depths of plaster and
/// bare roofs; noise of the camera is averaged by resampling.
constexpr float kNoiseVariance = 0.1F;

// Common to all presets.

/// Spacing of patch samples at the equator [px of the depth map].
constexpr double kPatchSpacing_px = 2.0;

/// Minimum variance of a textured patch: kTexturedPerNoise times the image noise, clamped to standard deviations of 1.5
/// to 3 gray levels; the maximum applies to images with texture all over, which seem noisy.
constexpr float kTexturedVariance = 1.5F * 1.5F;
constexpr float kTexturedPerNoise = 2.6F;
constexpr float kMaxTexturedVariance = 3.0F * 3.0F;
constexpr float kFarVariance = 0.5F * 0.5F;

/// Standard deviation of the spatial weight [px of the depth map]: about half a coarse patch.
constexpr double kSigmaSpace_px = 5.0;

/// Maximum angle between a plane's normal and the ray [deg]: beyond it, a pixel's patch covers many times its usual
/// area.
constexpr double kMaxSlant_deg = 80.0;

/// Score penalty for full disagreement with one source view's depth map; photometric scores span 2.
constexpr float kDisagreementCost = 0.5F;

}  // namespace

float textured_variance(float noise) {
  return std::clamp(kTexturedPerNoise * noise, kTexturedVariance, kMaxTexturedVariance);
}

float far_variance(float noise) { return std::clamp(kTexturedPerNoise * noise, kFarVariance, kMaxTexturedVariance); }

kernels::PatchParams patch_params(const PatchMatchOptions& options, int width, float noise) {
  kernels::PatchParams params{};
  const auto spacing = [&](double pixels) { return static_cast<float>(std::tan(pixels * 2.0 * kernels::kPi / width)); };
  params.spacing = spacing(kPatchSpacing_px);
  params.fine_spacing = spacing(kPatchSpacing_px * options.fine_patch);
  params.fine_variance = options.fine_patch < 1.0 ? textured_variance(noise) : -1.0F;
  params.min_sigma_color = static_cast<float>(std::min(options.min_sigma_color, options.sigma_color));
  params.max_sigma_color = static_cast<float>(options.sigma_color);
  params.min_variance = kNoiseVariance;
  params.disagreement_cost = kDisagreementCost;
  params.disagreement_tolerance = kDisagreementTolerance;
  const auto weigh = [](float* weights, double size) {
    const double steps = kSigmaSpace_px / (kPatchSpacing_px * size);
    for (int k = 0; k < kernels::kPatchSamples; ++k) {
      const double dx = kernels::patch_offset(k % kernels::kPatchSide);
      const double dy = kernels::patch_offset(k / kernels::kPatchSide);
      weights[k] = static_cast<float>(std::exp(-0.5 * (dx * dx + dy * dy) / (steps * steps)));
    }
  };
  weigh(params.space_weight, 1.0);
  weigh(params.fine_space_weight, options.fine_patch);
  return params;
}

kernels::PlaneLimits plane_limits(const DepthRange& range) {
  const double min_cos = std::cos(kMaxSlant_deg * kernels::kPi / 180.0);
  return {static_cast<float>(1.0 / range.max), static_cast<float>(1.0 / range.min),
          static_cast<float>(min_cos * min_cos)};
}

kernels::RandomKey patchmatch_key(std::uint64_t seed, std::int64_t keyframe_id) {
  return kernels::random_key(seed, static_cast<std::uint64_t>(keyframe_id), kPatchMatchStage);
}

Iterations iterations_of(const PatchMatchOptions& options, int pass) {
  if (pass == 0) return {0, options.iterations};
  return {options.iterations + (pass - 1) * kGeometricIterations, kGeometricIterations};
}

int planes_tried(const PatchMatchOptions& options) {
  constexpr int kInitialPlanes = 3, kRescoredPlanes = 2;
  const int per_iteration = kernels::kPropagatedPlanes + options.refinements;
  const int rescored_current = options.neighbours >= kernels::kMinWeightedViews ? 1 : 0;
  return kInitialPlanes + options.iterations * (rescored_current + per_iteration) +
         options.geometric_passes * (kRescoredPlanes + kGeometricIterations * per_iteration);
}

}  // namespace pmsp
