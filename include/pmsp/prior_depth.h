// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>

#include "pmsp/api.h"
#include "pmsp/image.h"
#include "pmsp/keyframe.h"

namespace pmsp {

/// What the values v of a depth image from elsewhere stand for, up to a scale and a shift.
enum class DepthModel {
  kScaled,   ///< depth = scale * v: lidar, metric networks, other reconstructions
  kDepth,    ///< depth = scale * v + shift
  kInverse,  ///< 1 / depth = scale * v + shift: disparities, what most networks give
  kWarped,   ///< 1 / depth = scale / v + shift: depth made of disparities whose shift was not known
};
PMSP_API const char* name_of(DepthModel model);  ///< for people: "inverse depth", ...

/// How a depth image fits a keyframe's landmarks.
struct DepthAlignment {
  DepthModel model = DepthModel::kScaled;
  double scale = 0.0;
  double shift = 0.0;
  std::size_t landmarks = 0;  ///< that have a value in the image
  double share = 0.0;         ///< of them, within 15 % of their depth
  double error = 0.0;         ///< median relative error of the depths of these
  std::string why_not;        ///< it does not fit; "" = it does
};

/// Finds scale (> 0) and shift of an image of values along each pixel's ray (0, or not finite = none) by the
/// keyframe's landmarks: of pairs of landmarks (RANSAC, the same pairs each time) for each model the one that most
/// agree with, then least squares of what agrees. The model with the smallest sum of relative errors (each at most
/// 15 %) is taken; kScaled where it is hardly worse. Left out is an image with fewer than 12 landmarks, one in which
/// less than 60 % of them agree, and one that tells little more than the same depth everywhere.
PMSP_API DepthAlignment align_prior_depth(ImageView<const float> values, const Keyframe& keyframe);

/// How depths compare with those of the keyframe's landmarks: the median of their ratios, > 0; 0 where fewer than 12
/// landmarks have a depth in the image.
PMSP_API double depth_ratio(ImageView<const float> depth, const Keyframe& keyframe);

/// The image as Keyframe::prior_depth takes it; 0 where it gives no depth > 0.
PMSP_API Image<float> aligned_depth(ImageView<const float> values, const DepthAlignment& alignment);

}  // namespace pmsp
