// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Source elements of a target element: weights[i] belongs to first + i.
struct ResampleSpan {
  int first = 0;
  std::vector<float> weights;
};

/// Spans of all target elements along one axis: means over the area, or linear interpolation for enlargement. They may
/// extend one element beyond either end.
std::vector<ResampleSpan> resample_spans(int source, int target);

/// Gray value of a colour (ITU-R BT.601).
inline float luma(const Eigen::Vector3f& color) { return color.dot(Eigen::Vector3f(0.299F, 0.587F, 0.114F)); }

/// Resizes an equirectangular image: means over the area of each target pixel (partial pixels by their share), or
/// linear interpolation between pixel centres for enlargement. x wraps. Values stay on the scale 0 to 255.
Image<Eigen::Vector3f> area_resize(ImageView<const Rgb> image, int width, int height, ThreadPool& pool);

/// As area_resize, for gray values (luma).
Image<float> area_resize_gray(ImageView<const Rgb> image, int width, int height, ThreadPool& pool);

}  // namespace pmsp
