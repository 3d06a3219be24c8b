// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "agreement.h"
#include "plane.h"

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

/// Below this score more is to be expected than geometry tells, in proportion, up to twice as much: where there is no
/// texture, maps may agree because they started from the same prior (plane_prior.h).
constexpr float kTrustedScore = 0.9F;

/// The relative error to be expected (its median, fitted to ground truth); large where no map agrees.
template <class F>
PMSP_HD F expected_error(const Evidence<F>& evidence, float pixel_angle) {
  constexpr float kFloor = 3e-4F;  // what a figure may be by chance
  constexpr float kCalibration = 0.45F;
  const F agree = max(evidence.agree, F(0.1F));
  const F spread = sqrt(evidence.square_spread / agree) + F(kFloor);
  const F resolution = F(pixel_angle) / sqrt(evidence.square_gain + F(1e-8F));
  const F mean = sqrt((evidence.roughness + F(kFloor)) * sqrt(spread * resolution));
  const F doubt = F(kTrustedScore) / min(max(evidence.score, F(0.5F * kTrustedScore)), F(kTrustedScore));
  return F(kCalibration) * mean * doubt * evidence.maps / agree;
}

PMSP_HD float expected_error(const Votes& votes, float roughness, int maps, float score, float pixel_angle) {
  return expected_error<float>({votes.square_spread, votes.square_gain, roughness, static_cast<float>(votes.agree),
                                static_cast<float>(maps), score},
                               pixel_angle);
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

}  // namespace pmsp::kernels
