// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "patch.h"

// Depth evidence of an image before matching. Parallax moves the content of a pixel along a line, towards or away from
// the other camera; only changes of gray value along this line determine the shift. An edge parallel to it, such as
// that of a ceiling along the path of the camera, looks alike at any depth. An edge across it determines the depth of
// its own points, but not the slant of the surface, so that the depth beside it stays uncertain.
namespace pmsp::kernels {

/// Baselines from a keyframe's camera to those of its source views, in its frame and unit.
struct Baselines {
  Vec3<float> to[kMaxViews];
  int count;
};

template <class F>
struct DepthEvidence {
  F variance;  ///< of the surrounding gray values, without a linear ramp (shading is no texture)
  /// Information on the shift along the line, times the squared length of the baseline across the ray: sum of squared
  /// gray differences, less the loss to the unknown slant.
  F certainty;
  Vec3<F> best;  ///< direction near the pixel with the most certain shift; any length
};

/// Prior information on the slant, as squared gray difference at a distance of one sample: the depth changes by some
/// percent from sample to sample at most.
constexpr float kSlantCertainty = 100.0F;

/// Uses the baseline that is longest across the ray. `frame`: of samples, kPatchSide per row.
template <class F, class Cube>
PMSP_HD DepthEvidence<F> depth_evidence(const Cube& image, const PatchFrame<F>& frame, float spacing,
                                        const Baselines& baselines) {
  F x(1);
  F y(0);
  F across(0);  // squared length of the baseline across the ray
  for (int k = 0; k < baselines.count; ++k) {
    const Vec3<float>& t = baselines.to[k];
    const Vec3<F> to{F(t.x), F(t.y), F(t.z)};
    const F right = dot(to, frame.right) * F(1.0F / spacing);
    const F down = dot(to, frame.down) * F(1.0F / spacing);
    const F square = fma(right, right, down * down);
    const auto longer = square > across;
    x = select(longer, right, x);
    y = select(longer, down, y);
    across = select(longer, square, across);
  }
  const F scale = F(1) / sqrt(max(fma(x, x, y * y), F(1e-30F)));
  const F u = scale * x;
  const F v = scale * y;
  const Vec3<F> along = fma(u, frame.right, v * frame.down);
  const Vec3<F> perpendicular = fma(u, frame.down, (F(0) - v) * frame.right);

  const F center = sample(image, frame.bearing);
  F gray_sum(0), gray_square(0), gray_x(0), gray_y(0);
  F sum(0), sum_x(0), sum_y(0), sum_xx(0), sum_yy(0), sum_xy(0);
  float spread = 0.0F;
  PMSP_ROLL
  for (int j = 0; j < kPatchSide; ++j) {
    const Vec3<F> line = fma(F(patch_offset(j)), perpendicular, frame.bearing);
    const F at_y(patch_offset(j));
    F before(0);
    for (int i = 0; i < kPatchSide; ++i) {
      const F gray = sample(image, fma(F(patch_offset(i)), along, line)) - center;
      gray_sum = gray_sum + gray;
      gray_square = fma(gray, gray, gray_square);
      gray_x = fma(F(patch_offset(i)), gray, gray_x);
      gray_y = fma(at_y, gray, gray_y);
      spread += patch_offset(i) * patch_offset(i);
      const F step = i == 0 ? F(0) : gray - before;
      const F at_x(patch_offset(i) - 0.5F);
      const F square = step * step;
      sum = sum + square;
      sum_x = fma(square, at_x, sum_x);
      sum_y = fma(square, at_y, sum_y);
      sum_xx = fma(square * at_x, at_x, sum_xx);
      sum_yy = fma(square * at_y, at_y, sum_yy);
      sum_xy = fma(square * at_x, at_y, sum_xy);
      before = gray;
    }
  }
  const F of_ramp = fma(gray_x, gray_x, gray_y * gray_y) * F(1.0F / spread);
  const F rest = gray_square - gray_sum * gray_sum * F(1.0F / kPatchSamples) - of_ramp;
  // Least squares for shift and slant: information on the shift after elimination of the slant's two unknowns.
  const F a = sum_xx + F(kSlantCertainty);
  const F c = sum_yy + F(kSlantCertainty);
  const F lost = (c * sum_x * sum_x - F(2) * sum_xy * sum_x * sum_y + a * sum_y * sum_y) / (a * c - sum_xy * sum_xy);
  const F share = F(1) / max(sum, F(1));
  return {max(rest, F(0)) * F(1.0F / kPatchSamples), across * max(sum - lost, F(0)),
          fma(share * sum_x, along, fma(share * sum_y, perpendicular, frame.bearing))};
}

/// Minimum error of a match: noise times sample spacing [gray levels * rad]. Errors of poses, lenses and resampling are
/// angles, which finer maps do not reduce. Equals a noise of 0.7 gray levels at 640 columns, 1.6 at 1440.
constexpr float kLeastMatchingError = 0.0083F;

/// Standard error of the shift of a patch, times the root of its certainty. The uncorrelated part of the patches counts
/// as noise: `score` is their correlation. `variance`: of DepthEvidence.
PMSP_HD float matching_noise(float variance, float score, float spacing) {
  return max(spacing * sqrt((1.0F - min(max(score, 0.0F), 1.0F)) * variance), kLeastMatchingError);
}

/// Relative error of a depth, as far as it follows from the image. `variance`, `certainty`: of DepthEvidence.
PMSP_HD float matching_error(float variance, float certainty, float score, float spacing, float inverse_depth) {
  return matching_noise(variance, score, spacing) / (inverse_depth * sqrt(certainty) + 1e-9F);
}

}  // namespace pmsp::kernels
