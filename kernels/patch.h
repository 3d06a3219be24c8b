// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "agreement.h"
#include "cube.h"
#include "math.h"
#include "plane.h"

// The photometric score of a plane: bilaterally weighted normalised cross-correlation (NCC) between a patch on the
// tangent plane of the reference pixel and what the plane makes of it in a neighbouring view. The patch is a regular
// grid on the tangent plane, so it has one angular size everywhere on the sphere, and a plane maps it to the neighbour
// by a homography: three multiply-adds a sample, no trigonometry.
namespace pmsp::kernels {

constexpr int kPatchSide = 6;  ///< samples along one side
constexpr int kPatchSamples = kPatchSide * kPatchSide;
constexpr int kMaxViews = 8;  ///< neighbour views of one depth map

/// How patches are taken. All of it is the same for all pixels.
struct PatchLayout {
  float spacing;                      ///< distance of samples on the tangent plane (tangent of the angle)
  float fine_spacing;                 ///< the same where the fine patch has texture enough to be told from others
  float fine_variance;                ///< that much: variance [gray levels squared]
  float min_sigma_color;              ///< bilateral weights: smallest and largest standard deviation
  float max_sigma_color;              ///< [gray levels]
  float space_weight[kPatchSamples];  ///< exp(-r^2 / (2 sigma_space^2)), r = distance from the centre
  float min_variance;                 ///< variance (gray levels squared) that is noise rather than texture
  float disagreement_cost;            ///< what leaving a neighbour's surface by the tolerance or more takes off a score
  float disagreement_tolerance;       ///< relative depth
};

/// Offset of sample i (0 to kPatchSide - 1) from the centre, in steps of `spacing`.
PMSP_HD float patch_offset(int i) { return static_cast<float>(i) - 0.5F * static_cast<float>(kPatchSide - 1); }

/// What a reference pixel's patch contributes to all scores at this pixel: computed once for all planes and views.
template <class F>
struct ReferencePatch {
  F weight[kPatchSamples];    ///< bilateral weights, sum 1
  F contrast[kPatchSamples];  ///< weight * (gray - mean) / standard deviation
  F variance;                 ///< of the patch [gray levels squared]
};

/// The frame of a pixel: its bearing and the two tangent vectors, scaled to the patch's spacing.
template <class F>
struct PatchFrame {
  Vec3<F> bearing, right, down;
};

/// Standard deviation of the bilateral weights, in proportion to how far the patch's gray values spread around the
/// centre's. Spread is what 15 of the 36 samples keep within: half a patch of plaster beside a silhouette has little of
/// it, and then the silhouette's edge has no say; a patch that is textured all over keeps all its samples.
template <class F>
PMSP_HD F sigma_color(const F* differences, const PatchLayout& layout) {
  constexpr float kPerSpread = 3.0F;
  F low(0);
  F high(layout.max_sigma_color / kPerSpread);
  for (int step = 0; step < 5; ++step) {  // bisection
    const F middle = F(0.5F) * (low + high);
    F within(0);
    for (int k = 0; k < kPatchSamples; ++k) within = within + select(abs(differences[k]) <= middle, F(1), F(0));
    const auto enough = within >= F(15);
    high = select(enough, middle, high);
    low = select(enough, low, middle);
  }
  return min(max(F(kPerSpread) * high, F(layout.min_sigma_color)), F(layout.max_sigma_color));
}

template <class F>
PMSP_HD ReferencePatch<F> reference_patch(const CubeView& image, const PatchFrame<F>& frame,
                                          const PatchLayout& layout) {
  ReferencePatch<F> patch;
  const F center = sample(image, frame.bearing);
  for (int j = 0; j < kPatchSide; ++j) {
    const Vec3<F> left = fma(F(patch_offset(j)), frame.down, frame.bearing);
    for (int i = 0; i < kPatchSide; ++i) {
      patch.contrast[j * kPatchSide + i] = sample(image, fma(F(patch_offset(i)), frame.right, left)) - center;
    }
  }
  const F sigma = sigma_color(patch.contrast, layout);
  const F color_factor = F(-0.5F) / (sigma * sigma);
  F sum(0);
  F sum_gray(0);
  F sum_square(0);
  for (int k = 0; k < kPatchSamples; ++k) {
    const F gray = patch.contrast[k];
    const F weight = F(layout.space_weight[k]) * exp(max(gray * gray * color_factor, F(-40)));
    patch.weight[k] = weight;
    sum = sum + weight;
    sum_gray = fma(weight, gray, sum_gray);
    sum_square = fma(weight * gray, gray, sum_square);
  }
  const F scale = F(1) / sum;
  const F mean = sum_gray * scale;
  patch.variance = max(fma(F(0) - mean, mean, sum_square * scale), F(0));
  const F inverse_deviation = F(1) / sqrt(patch.variance + F(layout.min_variance));
  for (int k = 0; k < kPatchSamples; ++k) {
    const F weight = patch.weight[k] * scale;
    patch.weight[k] = weight;
    patch.contrast[k] = weight * (patch.contrast[k] - mean) * inverse_deviation;
  }
  return patch;
}

/// One neighbour view: its image and `view_from_ref`.
struct SourceView {
  CubeView image;
  CubeView usable;  ///< 255 where a patch may be matched, 0 where the mask forbids it; no quads = everywhere
  Rigid view_from_ref;
  PlaneMapView surface = {nullptr, nullptr, nullptr, 0, 0};  ///< its depth map so far; no planes = not known
};

/// The patch frame as a neighbour's camera sees it, rotation only: computed once for all planes.
template <class F>
struct RotatedFrame {
  Vec3<F> bearing, right, down;
};

template <class F>
PMSP_HD RotatedFrame<F> rotated(const PatchFrame<F>& frame, const SourceView& view) {
  return {rotate(view.view_from_ref, frame.bearing), rotate(view.view_from_ref, frame.right),
          rotate(view.view_from_ref, frame.down)};
}

/// NCC of the reference patch with one neighbour under a plane, in [-1, 1]. A direction x of the reference meets the
/// plane at x / (plane . x); up to that length the neighbour sees it along R x + t (plane . x), which is linear in x.
template <class F>
PMSP_HD F view_score(const ReferencePatch<F>& patch, const PatchFrame<F>& frame, const RotatedFrame<F>& turned,
                     const SourceView& view, const Vec3<F>& plane, const PatchLayout& layout) {
  const Vec3<F> t = translation<F>(view.view_from_ref);
  const Vec3<F> right = fma(dot(plane, frame.right), t, turned.right);
  const Vec3<F> down = fma(dot(plane, frame.down), t, turned.down);
  const Vec3<F> center = fma(dot(plane, frame.bearing), t, turned.bearing);
  Vec3<F> left = fma(F(patch_offset(0)), right, fma(F(patch_offset(0)), down, center));
  F sum(0);
  F square(0);
  F product(0);
  for (int j = 0; j < kPatchSide; ++j) {
    Vec3<F> p = left;
    for (int i = 0; i < kPatchSide; ++i) {
      const int k = j * kPatchSide + i;
      const F gray = sample(view.image, p);
      const F weighted = patch.weight[k] * gray;
      sum = sum + weighted;
      square = fma(weighted, gray, square);
      product = fma(patch.contrast[k], gray, product);
      p = p + right;
    }
    left = left + down;
  }
  const F variance = max(fma(F(0) - sum, sum, square), F(0));
  const F score = product / sqrt(variance + F(layout.min_variance));
  if (view.usable.quads == nullptr) return score;
  return select(sample(view.usable, center) > F(127), score, F(-1));
}

/// view_score, less what the neighbour's own depth map has against the plane (Schoenberger et al. 2016; Xu and Tao
/// 2019): a wrong depth that looks alike in one pair of images rarely does in another.
template <class F>
PMSP_HD F checked_score(const ReferencePatch<F>& patch, const PatchFrame<F>& frame, const RotatedFrame<F>& turned,
                        const SourceView& view, const Vec3<F>& plane, const PatchLayout& layout) {
  const F score = view_score(patch, frame, turned, view, plane, layout);
  if (view.surface.x == nullptr) return score;
  const F off = disagreement(frame.bearing, dot(plane, frame.bearing), view.surface, view.view_from_ref);
  return score - F(layout.disagreement_cost) * min(off * F(1.0F / layout.disagreement_tolerance), F(1));
}

/// Score of a plane over all views, between the mean over the better half of them and the mean over all. In the better
/// half, a view that does not see the surface has no say; all together are less noisy. Half of each measured best (two
/// views: 0.75 and 0.25). The order of the views does not matter.
template <class F>
PMSP_HD F plane_score(const ReferencePatch<F>& patch, const PatchFrame<F>& frame, const RotatedFrame<F>* turned,
                      const SourceView* views, int num_views, const Vec3<F>& plane, const PatchLayout& layout) {
  const int kept = (num_views + 1) / 2;
  F best[(kMaxViews + 1) / 2] = {F(-1), F(-1), F(-1), F(-1)};
  F all(0);
  for (int view = 0; view < num_views; ++view) {
    F score = checked_score(patch, frame, turned[view], views[view], plane, layout);
    all = all + score;
    for (int k = 0; k < kept; ++k) {  // insertion into the sorted list of the best
      const F better = max(best[k], score);
      score = min(best[k], score);
      best[k] = better;
    }
  }
  F sum = best[0];
  for (int k = 1; k < kept; ++k) sum = sum + best[k];
  return fma(sum, F(0.5F / static_cast<float>(kept)), all * F(0.5F / static_cast<float>(num_views)));
}

}  // namespace pmsp::kernels
