// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "agreement.h"
#include "cube.h"
#include "elementary.h"
#include "plane.h"

// Photometric score of a plane: bilaterally weighted normalised cross-correlation (NCC) between a patch on the tangent
// plane of the reference pixel and its warp into a source view. The patch is a regular grid on the tangent plane: it
// has one angular size everywhere on the sphere, and a plane maps it to the source view by a homography with three
// multiply-adds per sample, without trigonometry.
namespace pmsp::kernels {

constexpr int kPatchSide = 6;  ///< samples along one side
constexpr int kPatchSamples = kPatchSide * kPatchSide;
constexpr int kMaxViews = 8;  ///< source views of one depth map

/// Parameters of patches, common to all pixels.
struct PatchParams {
  float spacing;                           ///< distance of samples on the tangent plane (tangent of the angle)
  float fine_spacing;                      ///< the same for the fine patch
  float fine_variance;                     ///< the fine patch is used if its variance is larger [gray levels squared]
  float min_sigma_color;                   ///< minimum standard deviation of the bilateral weights [gray levels]
  float max_sigma_color;                   ///< maximum [gray levels]
  float space_weight[kPatchSamples];       ///< exp(-r^2 / (2 sigma_space^2)), r = distance from the centre
  float fine_space_weight[kPatchSamples];  ///< of the fine patch
  float min_variance;  ///< variance of noise [gray levels squared], added to variances: lowers scores without texture
  float disagreement_cost;       ///< maximum penalty for deviation from a source view's surface
  float disagreement_tolerance;  ///< relative depth difference from which on the penalty is maximal
};

/// Offset of sample i (0 to kPatchSide - 1) from the centre, in steps of `spacing`.
PMSP_HD float patch_offset(int i) { return static_cast<float>(i) - 0.5F * static_cast<float>(kPatchSide - 1); }

/// Reference patch of a pixel, computed once for all planes and views. src/cuda/shared_patch.h has the same members in
/// half precision.
template <class F>
struct ReferencePatch {
  F weights[kPatchSamples];
  F values[kPatchSamples];
  F center;        ///< gray value; scores use differences from it, which are small, as is their rounding error
  F variance;      ///< of the patch [gray levels squared]
  F weight_sum;    ///< 1 except for rounding
  F value_sum;     ///< 0 except for rounding
  MaskOf<F> fine;  ///< whether it is the fine patch

  PMSP_HD F weight(int k) const { return weights[k]; }  ///< bilateral weight
  PMSP_HD F value(int k) const {
    return values[k];
  }  ///< weight * (gray - mean) / standard deviation; during load_patch gray - center
  PMSP_HD void put(int k, const F& weight, const F& value) {
    weights[k] = weight;
    values[k] = value;
  }
};

/// Frame of a pixel: bearing, and two tangent vectors of the length of the sample spacing.
template <class F>
struct PatchFrame {
  Vec3<F> bearing, right, down;
};

/// Frame from the sines and cosines of a pixel's longitude and latitude.
template <class F>
PMSP_HD PatchFrame<F> patch_frame(const F& sin_lon, const F& cos_lon, const F& sin_lat, const F& cos_lat,
                                  const F& spacing) {
  return {bearing(sin_lon, cos_lon, sin_lat, cos_lat), spacing * tangent_right(sin_lon, cos_lon),
          spacing * tangent_down(sin_lon, cos_lon, sin_lat, cos_lat)};
}

/// Standard deviation of the bilateral weights relative to the spread of the patch: the deviation from the centre that
/// 15 of the 36 samples do not exceed. Beside a silhouette it is small and excludes the silhouette; in full
/// texture it keeps all samples. Fine patches use a smaller factor; untextured ones need the weak edges around them.
constexpr float kSigmaPerSpread = 3.0F;
constexpr float kFineSigmaPerSpread = 1.5F;

/// `per_spread`: kSigmaPerSpread or kFineSigmaPerSpread.
template <class F, class Patch>
PMSP_HD F sigma_color(const Patch& patch, const PatchParams& params, const F& per_spread) {
  F low(0);
  F high = F(params.max_sigma_color) / per_spread;
  PMSP_ROLL
  for (int step = 0; step < 5; ++step) {  // bisection
    const F middle = F(0.5F) * (low + high);
    F within(0);
    for (int k = 0; k < kPatchSamples; ++k) within = within + select(abs(patch.value(k)) <= middle, F(1), F(0));
    const auto enough = within >= F(15);
    high = select(enough, middle, high);
    low = select(enough, low, middle);
  }
  return min(max(per_spread * high, F(params.min_sigma_color)), F(params.max_sigma_color));
}

/// Minimum logarithm of a bilateral weight: normalised weights stay representable in half precision.
constexpr float kLeastLogWeight = -9.0F;

/// `Cube`: CubeView, or another type with `sample` and `is_empty`. `Patch`: ReferencePatch<F> or compatible. `fine`:
/// whether the frame is that of the fine patch.
template <class Patch, class F, class Cube>
PMSP_HD void load_patch(Patch& patch, const Cube& image, const PatchFrame<F>& frame, const PatchParams& params,
                        const MaskOf<F>& fine) {
  patch.center = sample(image, frame.bearing);
  PMSP_ROLL
  for (int j = 0; j < kPatchSide; ++j) {
    const Vec3<F> left = fma(F(patch_offset(j)), frame.down, frame.bearing);
    PMSP_UNROLL
    for (int i = 0; i < kPatchSide; ++i) {
      patch.put(j * kPatchSide + i, F(0), sample(image, fma(F(patch_offset(i)), frame.right, left)) - patch.center);
    }
  }
  patch.fine = fine;
  const F sigma = sigma_color<F>(patch, params, select(fine, F(kFineSigmaPerSpread), F(kSigmaPerSpread)));
  const F color_factor = F(-0.5F) / (sigma * sigma);
  F sum(0);
  F sum_gray(0);
  F sum_square(0);
  for (int k = 0; k < kPatchSamples; ++k) {
    const F gray = patch.value(k);
    const F space = select(fine, F(params.fine_space_weight[k]), F(params.space_weight[k]));
    const F weight = space * kernels::exp(max(gray * gray * color_factor, F(kLeastLogWeight)));
    patch.put(k, weight, gray);
    sum = sum + weight;
    sum_gray = fma(weight, gray, sum_gray);
    sum_square = fma(weight * gray, gray, sum_square);
  }
  const F scale = F(1) / sum;
  const F mean = sum_gray * scale;
  patch.variance = max(fma(F(0) - mean, mean, sum_square * scale), F(0));
  const F inverse_deviation = F(1) / sqrt(patch.variance + F(params.min_variance));
  patch.weight_sum = F(0);
  patch.value_sum = F(0);
  for (int k = 0; k < kPatchSamples; ++k) {
    const F weight = patch.weight(k) * scale;
    patch.put(k, weight, weight * (patch.value(k) - mean) * inverse_deviation);
    patch.weight_sum = patch.weight_sum + patch.weight(k);
    patch.value_sum = patch.value_sum + patch.value(k);
  }
}

/// Type of plane maps that belongs to a type of images.
template <class Cube>
struct SurfaceOf {
  using Type = PlaneMapView;
};

/// Source view: image and `view_from_ref`.
template <class Cube>
struct SourceView {
  Cube image;
  Cube matchable;  ///< 255 where a patch may be matched, 0 near masked pixels; empty = no mask
  Rigid view_from_ref;
  typename SurfaceOf<Cube>::Type surface;  ///< its plane map so far; empty = unknown
};

/// NCC of the reference patch with a source view under a plane, in [-1, 1]. A direction x of the reference meets the
/// plane at x / (plane . x); the direction in the source view is R x + t (plane . x), up to its length, which is linear
/// in x.
template <class Patch, class F, class Cube>
PMSP_HD F view_score(const Patch& patch, const PatchFrame<F>& frame, const SourceView<Cube>& view, const Vec3<F>& plane,
                     const PatchParams& params) {
  const Vec3<F> turned = rotate(view.view_from_ref, frame.bearing);
  const F inverse_depth = dot(plane, frame.bearing);
  const Vec3<F> t = translation(view.view_from_ref, frame.bearing, turned, inverse_depth);
  const Vec3<F> right = fma(dot(plane, frame.right), t, rotate(view.view_from_ref, frame.right));
  const Vec3<F> down = fma(dot(plane, frame.down), t, rotate(view.view_from_ref, frame.down));
  const Vec3<F> center = fma(inverse_depth, t, turned);
  Vec3<F> left = fma(F(patch_offset(0)), right, fma(F(patch_offset(0)), down, center));
  F sum(0);
  F square(0);
  F product(0);
  PMSP_ROLL
  for (int j = 0; j < kPatchSide; ++j) {
    Vec3<F> p = left;
    PMSP_UNROLL
    for (int i = 0; i < kPatchSide; ++i) {
      const int k = j * kPatchSide + i;
      const F gray = sample(view.image, p) - patch.center;
      const F weighted = patch.weight(k) * gray;
      sum = sum + weighted;
      square = fma(weighted, gray, square);
      product = fma(patch.value(k), gray, product);
      p = p + right;
    }
    left = left + down;
  }
  const F scale = F(1) / patch.weight_sum;
  const F mean = sum * scale;
  const F variance = max(fma(F(0) - mean, mean, square * scale), F(0));
  const F score = fma(F(0) - mean, patch.value_sum, product) / sqrt(variance + F(params.min_variance));
  if (is_empty(view.matchable)) return score;
  return select(sample(view.matchable, center) > F(127), score, F(-1));
}

/// Result of a source view for a plane.
template <class F>
struct ViewResult {
  F score;       ///< view_score, less the penalty by its own depth map
  F visibility;  ///< 1 up to one tolerance behind the view's surface, 0 from two; 1 without texture
};

/// Photometric score less a penalty for deviation from the depth map of the source view (geometric consistency,
/// Schoenberger et al. 2016; Xu and Tao 2019).
template <class Patch, class F, class Cube>
PMSP_HD ViewResult<F> view_result(const Patch& patch, const PatchFrame<F>& frame, const SourceView<Cube>& view,
                                  const Vec3<F>& plane, const PatchParams& params) {
  const F score = view_score(patch, frame, view, plane, params);
  if (is_empty(view.surface) || !(params.disagreement_cost > 0.0F)) return {score, F(1)};
  const F off = F(1.0F / params.disagreement_tolerance) *
                beyond_surface(frame.bearing, dot(plane, frame.bearing), view.surface, view.view_from_ref);
  return {score - F(params.disagreement_cost) * min(abs(off), F(1)),
          select(patch.fine, min(max(F(2) - off, F(0)), F(1)), F(1))};
}

/// Weights of the source views at a pixel, from the scores of its current plane: low where the surface is occluded
/// (Zheng et al. 2014; Xu and Tao 2019 use several planes).
template <class F>
struct ViewWeights {
  F of[kMaxViews];
};

/// Standard deviation for the weight of a view: difference of its score from 1.
constexpr float kSigmaOfViewScore = 0.15F;

/// Minimum number of views for weights. With two, the better half is one view; weights would discard the other.
constexpr int kMinWeightedViews = 3;

template <class F>
PMSP_HD void set_equal_weights(ViewWeights<F>& weights) {
  for (F& weight : weights.of) weight = F(1);
}

/// Sets weights to 1 except for pixels of `where`.
template <class F>
PMSP_HD void keep_weights_where(ViewWeights<F>& weights, const MaskOf<F>& where) {
  for (F& weight : weights.of) weight = select(where, weight, F(1));
}

/// Weight of a view from its score for the current plane; > 0.
template <class F>
PMSP_HD F view_weight(const F& score) {
  constexpr float kFactor = -0.5F / (kSigmaOfViewScore * kSigmaOfViewScore);
  const F off = F(1) - score;
  return kernels::exp(max(F(kFactor) * off * off, F(-30)));
}

/// Score of a plane over all views: half the mean over their better half, half the weighted mean over all (two views:
/// 0.75 and 0.25). The better half excludes views that do not see the surface; the mean over all has less noise. The
/// weighted mean excludes views from which this plane is hidden, unless it is hidden from all. Independent of the order
/// of views. `weigh`: the plane is the pixel's current one; the weights are computed from its scores.
template <class Patch, class F, class Cube>
PMSP_HD F plane_score(const Patch& patch, const PatchFrame<F>& frame, const SourceView<Cube>* views, int num_views,
                      const Vec3<F>& plane, const PatchParams& params, ViewWeights<F>& weights, bool weigh) {
  const int kept = (num_views + 1) / 2;
  static_assert((kMaxViews + 1) / 2 == 4, "a -1 for each of the better half");
  F best[(kMaxViews + 1) / 2] = {F(-1), F(-1), F(-1), F(-1)};
  F weighted(0);
  F weight_sum(0);
  PMSP_ROLL
  for (int view = 0; view < num_views; ++view) {
    const ViewResult<F> result = view_result(patch, frame, views[view], plane, params);
    F score = result.score;
    if (weigh && num_views >= kMinWeightedViews) weights.of[view] = view_weight(score);
    const F weight = weights.of[view] * max(result.visibility, F(1e-3F));
    weighted = fma(weight, score, weighted);
    weight_sum = weight_sum + weight;
    for (int k = 0; k < kept; ++k) {  // insertion into the sorted list of the best
      const F better = max(best[k], score);
      score = min(best[k], score);
      best[k] = better;
    }
  }
  F sum = best[0];
  for (int k = 1; k < kept; ++k) sum = sum + best[k];
  return fma(sum, F(0.5F / static_cast<float>(kept)), F(0.5F) * weighted / weight_sum);
}

}  // namespace pmsp::kernels
