// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "agreement.h"
#include "plane.h"
#include "stage.h"

// Expected relative error of a depth, from three quantities that grow with the error: spread of agreeing maps,
// deviation of surrounding planes, and depth resolution at the parallax. Their geometric mean ranks pixels better than
// each alone, and better than the photometric score, which is high on repeated patterns and blurred edges. A low score
// increases the expected error.
namespace pmsp::kernels {

/// Offsets of the surrounding pixels for the roughness [px].
constexpr int kRoughnessOffsets = 8;
PMSP_HD void roughness_offset(int i, int& dx, int& dy) {
  const int distance = i < 4 ? 3 : 6;
  dx = (i & 3) == 0 ? distance : (i & 3) == 1 ? -distance : 0;
  dy = (i & 3) == 2 ? distance : (i & 3) == 3 ? -distance : 0;
}

constexpr float kMaxRoughness = 0.1F;

/// Relative deviation of a neighbour's plane from a pixel's depth, along its ray; largest for zero planes.
template <class F>
PMSP_HD F deviation(const Vec3<F>& neighbour, const Vec3<F>& bearing, const F& depth) {
  const F ratio = depth * dot(neighbour, bearing);
  return select(ratio > F(0), min(abs(ratio - F(1)), F(kMaxRoughness)), F(kMaxRoughness));
}

/// Evidence for a pixel's depth; deviations are relative to the depth.
template <class F>
struct Evidence {
  F square_spread;  ///< sum of squared deviations of agreeing maps
  F square_gain;    ///< sum of squared parallax gains of agreeing maps (agreement.h)
  F roughness;      ///< mean deviation of surrounding planes
  F agree;          ///< number of agreeing maps
  F maps;           ///< number of compared maps
  F score;          ///< see PlaneMap::score
};

/// Score below which the expected error grows in inverse proportion, down to the second value. Without texture, maps
/// may agree because they started from the same prior (plane_prior.h); differences of even lower scores are due to
/// chance.
constexpr float kTrustedScore = 0.95F;
constexpr float kMinAgreementScore = 0.39F;

/// Correction of the expected error for coarse maps, whose planes are farther apart and therefore deviate more than
/// those of equally accurate finer maps: fourth root of the width over that of the calibration, constant outside the
/// calibrated range.
PMSP_HD float width_correction(int width) {
  constexpr float kFitted = 1440.0F;
  constexpr float kCoarsest = 640.0F;
  return sqrt(sqrt(min(max(static_cast<float>(width), kCoarsest), kFitted) / kFitted));
}

/// Expected (median) relative error, calibrated with ground truth; large if no map agrees. The remaining spread has
/// other causes, such as poses. A score (a correlation) of s means noise of (1 - s) / s of the texture's variance: the
/// error of a measured shift grows with its root, above a floor set by interpolation, and that of the depth also with
/// the inverse parallax, even if maps agree because of a prior. `correction`: width_correction.
template <class F>
PMSP_HD F expected_error(const Evidence<F>& evidence, float correction) {
  constexpr float kFloor = 3e-4F;  // of spread and roughness, which may be small by chance
  constexpr float kCalibration = 0.185F;
  // Angular resolution [rad], that of 1440 columns at any size: coarser maps are matched on finer images, finer ones
  // are limited by the poses.
  constexpr float kResolved = 0.00436F;
  constexpr float kErrorPerSpread = 0.56F;
  constexpr float kErrorPerNoise = 0.077F;  // [px]
  constexpr float kLeastShift = 0.02F;      // error of a measured shift at a score of 1 [px]
  constexpr float kLeast = 5e-5F;
  const F agree = max(evidence.agree, F(0.1F));
  const F rms_deviation = sqrt(evidence.square_spread / agree);
  const F spread = rms_deviation + F(kFloor);
  const F resolution = F(kResolved) / sqrt(evidence.square_gain + F(1e-8F));
  const F mean = sqrt((evidence.roughness + F(kFloor)) * sqrt(spread * resolution));
  const F score = min(max(evidence.score, F(kMinAgreementScore)), F(1));
  const F doubt = F(kTrustedScore) / min(score, F(kTrustedScore));
  const F error = F(correction * kCalibration) * mean * doubt * evidence.maps / agree;
  const F of_spread = F(correction * kErrorPerSpread) * rms_deviation;
  const F square_shift = fma(F(kErrorPerNoise * kErrorPerNoise), (F(1) - score) / score, F(kLeastShift * kLeastShift));
  return sqrt(fma(error, error, fma(of_spread, of_spread, resolution * resolution * square_shift))) + F(kLeast);
}

/// Adds the effect of `pose_error` [rad] (Keyframe::pose_error) of both keyframes. It is common to all agreeing maps:
/// it does not show in their spread, and more maps do not reduce it.
template <class F>
PMSP_HD F add_pose_error(const F& error, const F& square_gain, const F& agree, float pose_error) {
  const F both(2.0F * pose_error * pose_error);
  return sqrt(fma(error, error, both * agree / max(square_gain, F(1e-8F))));
}

/// Relative error that gives a confidence of one half.
constexpr float kHalfConfidenceError = 0.005F;

template <class F>
PMSP_HD F confidence_of_error(const F& error) {
  return F(kHalfConfidenceError) / (F(kHalfConfidenceError) + error);
}

/// Inverse of confidence_of_error; confidences below 0.01 count as 0.01.
template <class F>
PMSP_HD F error_of_confidence(const F& confidence) {
  return F(kHalfConfidenceError) * (F(1) / max(confidence, F(0.01F)) - F(1));
}

/// Maximum number of maps that a map is compared with.
constexpr int kMaxCompared = 30;

template <class ViewTypes>
struct ComparedMap {
  typename ViewTypes::Map planes;
  Rigid other_from_first;
};

/// Consistency filter (pmsp::consistency_filter); a stage. Counts pixels with a plane, kept pixels with a depth, kept
/// far pixels.
template <class ViewTypes>
struct ConsistencyFilter {
  static constexpr int kCounts = 3;

  typename ViewTypes::Map map;
  GridView grid;
  ComparedMap<ViewTypes> others[kMaxCompared];
  int count;  ///< of `others`; 0 = none, or the filter is disabled
  int min_agreeing;
  float tolerance;
  float width_factor;      ///< width_correction
  float pose_error;        ///< of `map`'s keyframe [rad]
  float* confidence;       ///< without pose errors, which a keyframe's pixels have in common; 0 = no depth
  float* with_pose_error;  ///< with pose errors; nullptr = not needed

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const RowPixels<F>& at, MaskOf<F>* counted) const {
    const Vec3<F> bearing = bearing_at(grid, at);
    const Surface<F> surface = surface_of(plane_at<F>(map, at.index), bearing);
    const F score = min(score_at<F>(map, at.index), F(1));
    F found = score;
    F with_pose = score;
    const MaskOf<F> far = surface.depth > F(1.0F / kFarLimit);
    MaskOf<F> kept = surface.known;
    if (count > 0 && any(kept)) {
      const MaskOf<F> thin = kept & is_thin(at, bearing, surface.depth);
      Votes<F> votes;
      for (int k = 0; k < count; ++k) {
        const ComparedMap<ViewTypes>& other = others[k];
        Agreement<F> seen = agreement(bearing, surface.depth, other.planes, other.other_from_first);
        const MaskOf<F> missed = thin & is_seen_through(seen, tolerance);
        if (any(missed)) {
          seen.depth_ratio = select(missed, depth_ratio_around(seen, other.planes, tolerance), seen.depth_ratio);
        }
        // Far planes have the same inverse depth in any unit: the ratio of scales is no deviation.
        if (any(far))
          seen.depth_ratio =
              select(far & (seen.depth_ratio < F(1e3F)), select(seen.depth_ratio > F(0), F(1), F(0)), seen.depth_ratio);
        votes.add(seen, tolerance);
      }
      kept = kept & votes.keep(min_agreeing);
      if (any(kept)) {
        const Evidence<F> evidence{votes.square_spread,
                                   votes.square_gain,
                                   roughness(at, bearing, surface.depth),
                                   votes.agree,
                                   F(static_cast<float>(count)),
                                   score};
        const F error = expected_error(evidence, width_factor);
        found = confidence_of_error(error);
        with_pose = confidence_of_error(add_pose_error(error, votes.square_gain, votes.agree, pose_error));
      }
    }
    store<F>(select(kept, found, F(0)), confidence + at.first, at.count);
    if (with_pose_error != nullptr) store<F>(select(kept, with_pose, F(0)), with_pose_error + at.first, at.count);
    counted[0] = surface.known;
    counted[1] = kept & !far;
    counted[2] = kept & far;
  }

 private:
  /// Mean deviation of surrounding planes.
  template <class F>
  PMSP_HD F roughness(const RowPixels<F>& at, const Vec3<F>& bearing, const F& depth) const {
    F sum(0);
    for (int i = 0; i < kRoughnessOffsets; ++i) {
      int dx = 0;
      int dy = 0;
      roughness_offset(i, dx, dy);
      sum = sum + deviation(plane_beside(at, dx, dy), bearing, depth);
    }
    return sum * F(1.0F / kRoughnessOffsets);
  }

  /// Whether both sides, or above and below, are background. Pixels of the band by which an object is too wide have the
  /// object itself on one side.
  template <class F>
  PMSP_HD MaskOf<F> is_thin(const RowPixels<F>& at, const Vec3<F>& bearing, const F& depth) const {
    const auto lies_behind = [&](int dx, int dy) {
      const F ratio = depth * dot(plane_beside(at, dx, dy), bearing);
      return (ratio > F(0)) & (ratio < F(kBehindThinThing));
    };
    return (lies_behind(-kThinThingSide, 0) & lies_behind(kThinThingSide, 0)) |
           (lies_behind(0, -kThinThingSide) & lies_behind(0, kThinThingSide));
  }

  template <class F>
  PMSP_HD Vec3<F> plane_beside(const RowPixels<F>& at, int dx, int dy) const {
    return plane_at<F>(map, wrapped_index(grid, at, dx, dy));
  }
};

}  // namespace pmsp::kernels
