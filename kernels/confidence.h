// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "agreement.h"
#include "plane.h"
#include "stage.h"

// How far a depth may be off, told from three things that each grow with the error: how much the maps that agree
// differ, how much the plane differs from those around it, and what a pixel is worth in depth under the parallax at
// hand. Their geometric mean ranks pixels better than any of them alone, and better than the photometric score, which
// is high on a repeated pattern and on a blurred edge; but where that is low, the error is larger than they tell.
namespace pmsp::kernels {

/// Offsets of the pixels whose planes are compared with a pixel's own [px].
constexpr int kRoughnessOffsets = 8;
PMSP_HD void roughness_offset(int i, int& dx, int& dy) {
  const int distance = i < 4 ? 3 : 6;
  dx = (i & 3) == 0 ? distance : (i & 3) == 1 ? -distance : 0;
  dy = (i & 3) == 2 ? distance : (i & 3) == 3 ? -distance : 0;
}

constexpr float kMaxRoughness = 0.1F;

/// Relative deviation of the depth that a neighbour's plane implies at a pixel; zero planes deviate the most.
template <class F>
PMSP_HD F deviation(const Vec3<F>& neighbour, const Vec3<F>& bearing, const F& depth) {
  const F ratio = depth * dot(neighbour, bearing);
  return select(ratio > F(0), min(abs(ratio - F(1)), F(kMaxRoughness)), F(kMaxRoughness));
}

/// What is known of a pixel's depth; deviations are relative to the depth.
template <class F>
struct Evidence {
  F square_spread;  ///< sum of squared deviations of the maps that agree
  F square_gain;    ///< sum of their squared parallax gains (agreement.h)
  F roughness;      ///< mean deviation of the planes around
  F agree;          ///< number of maps that agree
  F maps;           ///< number of maps asked
  F score;          ///< how well the patches match
};

/// Below this score more is to be expected than geometry tells, with its inverse, down to the least score that counts:
/// where there is no texture, maps may agree because they started from the same prior (plane_prior.h), and what chance
/// makes of the score says no more.
constexpr float kTrustedScore = 0.95F;
constexpr float kLeastTellingScore = 0.39F;

/// Planes of a map of few columns lie far apart: they differ by more from each other, and from those of other maps,
/// than planes of a finer map that is as exact. What is told is less by the fourth root of the width, from that of the
/// maps that it was fitted to down to that of the coarsest ones that were measured. (Of 640 columns 1.4 to 1.9 times
/// too much was told where poses are exact.)
PMSP_HD float share_of_coarse_map(int width) {
  constexpr float kFitted = 1440.0F;
  constexpr float kCoarsest = 640.0F;
  return sqrt(sqrt(min(max(static_cast<float>(width), kCoarsest), kFitted) / kFitted));
}

/// The relative error to be expected (its median, fitted to the ground truth of five missions, two qualities, noise of
/// 1 to 5 gray levels); large where no map agrees. What maps differ by in spite of it is that of their poses, say.
/// A score (a correlation) of s says that noise has (1 - s) / s of the texture's variance. A shift measured in it is
/// off in proportion to the root, and the depth by as much over the parallax, even where the maps agree by a prior.
/// `share`: share_of_coarse_map.
template <class F>
PMSP_HD F expected_error(const Evidence<F>& evidence, float share) {
  constexpr float kFloor = 3e-4F;  // what a figure may be by chance
  constexpr float kCalibration = 0.185F;
  // A pixel of a map of 1440 [rad]: coarser maps have finer images, and are as exact; finer ones see the same poses.
  constexpr float kResolved = 0.00436F;
  constexpr float kOfSpread = 0.56F;
  constexpr float kOfNoise = 0.077F;  // [px]
  constexpr float kLeast = 5e-5F;
  const F agree = max(evidence.agree, F(0.1F));
  const F differs = sqrt(evidence.square_spread / agree);
  const F spread = differs + F(kFloor);
  const F resolution = F(kResolved) / sqrt(evidence.square_gain + F(1e-8F));
  const F mean = sqrt((evidence.roughness + F(kFloor)) * sqrt(spread * resolution));
  const F score = min(max(evidence.score, F(kLeastTellingScore)), F(1));
  const F doubt = F(kTrustedScore) / min(score, F(kTrustedScore));
  const F error = F(share * kCalibration) * mean * doubt * evidence.maps / agree;
  const F of_spread = F(share * kOfSpread) * differs;
  const F of_noise = F(kOfNoise) * resolution;
  const F square_of_noise = of_noise * of_noise * (F(1) - score) / score;
  return sqrt(fma(error, error, fma(of_spread, of_spread, square_of_noise))) + F(kLeast);
}

/// With what the poses add, `pose_error` [rad] (Keyframe::pose_error), once for each of two keyframes: all maps that
/// agree have it, so that their differences do not show it, and their number does not lessen it.
template <class F>
PMSP_HD F with_pose_error(const F& error, const F& square_gain, const F& agree, float pose_error) {
  const F both(2.0F * pose_error * pose_error);
  return sqrt(fma(error, error, both * agree / max(square_gain, F(1e-8F))));
}

/// Relative error that gives a confidence of one half.
constexpr float kHalfConfidenceError = 0.005F;

template <class F>
PMSP_HD F confidence_of_error(const F& error) {
  return F(kHalfConfidenceError) / (F(kHalfConfidenceError) + error);
}

/// The other way round; confidences below 0.01 count as that.
template <class F>
PMSP_HD F error_of_confidence(const F& confidence) {
  return F(kHalfConfidenceError) * (F(1) / max(confidence, F(0.01F)) - F(1));
}

/// Maps that one map is compared with at most.
constexpr int kMaxCompared = 30;

template <class Machine>
struct ComparedMap {
  typename Machine::Map planes;
  Rigid other_from_first;
};

/// The consistency filter (pmsp::consistency_filter); a stage. Counts pixels that have a plane, those that keep one
/// with a depth, and those that stay far.
template <class Machine>
struct ConsistencyFilter {
  static constexpr int kCounts = 3;

  typename Machine::Map map;
  GridView grid;
  ComparedMap<Machine> others[kMaxCompared];
  int count;  ///< of `others`; 0 = the filter does nothing
  int wanted;
  float tolerance;
  float share;        ///< share_of_coarse_map
  float pose_error;   ///< of `map`'s keyframe [rad]
  float* confidence;  ///< without what poses add, which a keyframe's pixels have in common; 0 = no depth
  float* to_report;   ///< with it; nullptr = not wanted

  PMSP_HD int width() const { return grid.width; }
  PMSP_HD int height() const { return grid.height; }

  template <class F>
  PMSP_HD void operator()(const Place<F>& at, MaskOf<F>* counted) const {
    const Vec3<F> bearing = bearing_at(grid, at);
    const Surface<F> surface = surface_of(plane_at<F>(map, at.index), bearing);
    const F score = min(score_at<F>(map, at.index), F(1));
    F found = score;
    F reported = score;
    const MaskOf<F> far = surface.depth > F(1.0F / kFarLimit);
    MaskOf<F> kept = surface.known;
    if (count > 0 && any(kept)) {
      const MaskOf<F> thin = kept & is_thin(at, bearing, surface.depth);
      Votes<F> votes;
      for (int k = 0; k < count; ++k) {
        const ComparedMap<Machine>& other = others[k];
        Agreement<F> seen = agreement(bearing, surface.depth, other.planes, other.other_from_first);
        const MaskOf<F> missed = thin & is_seen_through(seen, tolerance);
        if (any(missed)) {
          seen.depth_ratio = select(missed, depth_ratio_around(seen, other.planes, tolerance), seen.depth_ratio);
        }
        // Far planes have no unit of length, maps have.
        if (any(far))
          seen.depth_ratio =
              select(far & (seen.depth_ratio < F(1e3F)), select(seen.depth_ratio > F(0), F(1), F(0)), seen.depth_ratio);
        votes.add(seen, tolerance);
      }
      kept = kept & votes.keep(wanted);
      if (any(kept)) {
        const Evidence<F> evidence{votes.square_spread,
                                   votes.square_gain,
                                   roughness(at, bearing, surface.depth),
                                   votes.agree,
                                   F(static_cast<float>(count)),
                                   score};
        const F error = expected_error(evidence, share);
        found = confidence_of_error(error);
        reported = confidence_of_error(with_pose_error(error, votes.square_gain, votes.agree, pose_error));
      }
    }
    store<F>(select(kept, found, F(0)), confidence + at.first, at.count);
    if (to_report != nullptr) store<F>(select(kept, reported, F(0)), to_report + at.first, at.count);
    counted[0] = surface.known;
    counted[1] = kept & !far;
    counted[2] = kept & far;
  }

 private:
  /// Mean deviation of the planes around.
  template <class F>
  PMSP_HD F roughness(const Place<F>& at, const Vec3<F>& bearing, const F& depth) const {
    F sum(0);
    for (int i = 0; i < kRoughnessOffsets; ++i) {
      int dx = 0;
      int dy = 0;
      roughness_offset(i, dx, dy);
      sum = sum + deviation(plane_beside(at, dx, dy), bearing, depth);
    }
    return sum * F(1.0F / kRoughnessOffsets);
  }

  /// Whether what lies on both sides, or above and below, lies behind. A band by which a thing has grown is nearer to
  /// one of its sides than to the other, and so is not taken for thin.
  template <class F>
  PMSP_HD MaskOf<F> is_thin(const Place<F>& at, const Vec3<F>& bearing, const F& depth) const {
    const auto lies_behind = [&](int dx, int dy) {
      const F ratio = depth * dot(plane_beside(at, dx, dy), bearing);
      return (ratio > F(0)) & (ratio < F(kBehindThinThing));
    };
    return (lies_behind(-kThinThingSide, 0) & lies_behind(kThinThingSide, 0)) |
           (lies_behind(0, -kThinThingSide) & lies_behind(0, kThinThingSide));
  }

  template <class F>
  PMSP_HD Vec3<F> plane_beside(const Place<F>& at, int dx, int dy) const {
    return plane_at<F>(map, index_beside(grid, at, dx, dy));
  }
};

}  // namespace pmsp::kernels
