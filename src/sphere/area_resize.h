// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"
#include "util/thread_pool.h"

namespace pmsp {

/// The source elements of one target element: weights[i] belongs to first + i.
struct ResampleSpan {
  int first = 0;
  std::vector<float> weights;
};

/// Spans of all target elements along one axis: means over the area, or linear interpolation when enlarging. They may
/// reach one element beyond either end.
std::vector<ResampleSpan> resample_spans(int source, int target);

/// Gray value of a colour (ITU-R BT.601).
inline float luma(const Eigen::Vector3f& color) { return color.dot(Eigen::Vector3f(0.299F, 0.587F, 0.114F)); }

/// Resizes an equirectangular image: each target pixel is the mean over the area that it covers (partial pixels by
/// their share), or, when enlarging, linear interpolation between pixel centres. x wraps. Values stay on the scale 0 to
/// 255.
Image<Eigen::Vector3f> area_resize(ImageView<const Rgb> image, int width, int height, ThreadPool& pool);

/// The same of the gray values (luma) alone.
Image<float> area_resize_gray(ImageView<const Rgb> image, int width, int height, ThreadPool& pool);

}  // namespace pmsp
