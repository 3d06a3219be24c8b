// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::eval {

/// Index of the pixel in a row of `size` pixels that contains the centre of pixel i of a row of `of`.
inline int centre_index(int i, int of, int size) { return std::min(static_cast<int>((i + 0.5) * size / of), size - 1); }

/// Nearest-neighbour resampling at pixel centres.
template <class T>
Image<T> resampled(const Image<T>& image, int width, int height) {
  Image<T> result(width, height);
  for (int y = 0; y < height; ++y) {
    const int row = centre_index(y, height, image.height());
    for (int x = 0; x < width; ++x) result(x, y) = image(centre_index(x, width, image.width()), row);
  }
  return result;
}

/// Returns the true range at an image point [px of `truth`]: interpolated between pixels of one surface, linearly in
/// inverse range (exact for planes up to second order; at grazing angles adjacent pixels differ considerably), else
/// that of the nearest pixel.
float range_at(const Image<float>& truth, double x, double y);

/// Returns the true range of each pixel of `estimate`, NaN = unknown. Both images cover the whole sphere, in any size;
/// truth is range_at of the pixel centre. With `slack_px` > 0 it is the nearest to the estimate of (2 * slack_px + 1)^2
/// true values around the centre, to tolerate half a pixel at edges.
Image<float> true_ranges(const Image<float>& estimate, const Image<float>& truth, int slack_px);

/// Returns |estimate - truth| / truth per pixel of `estimate`, NaN where the truth is unknown, with the truth of
/// true_ranges. Unknown estimates (0) have error 1, to be excluded by the caller.
Image<float> relative_error(const Image<float>& estimate, const Image<float>& truth, int slack_px);

/// Solid angle of a pixel in row y, up to a constant factor: cos(latitude).
double row_weight(int y, int height);

/// Number of columns that span the same angle as `reach` rows: more towards the poles, at most a quarter of a row.
int columns_within(int reach, int y, int width, int height);

/// Pixel (column, row) of a point in camera frame.
Eigen::Vector2i pixel_of(const Eigen::Vector3d& in_cam, int width, int height);

/// Accumulates shares of pixels, plain and weighted by solid angle; NaN without pixels.
class Share {
 public:
  void add(bool counted, bool of, double weight) {
    if (!of) return;
    total_ += 1.0;
    total_weight_ += weight;
    if (!counted) return;
    counted_ += 1.0;
    counted_weight_ += weight;
  }
  double plain() const { return counted_ / total_; }
  double weighted() const { return counted_weight_ / total_weight_; }
  double total() const { return total_; }

 private:
  double counted_ = 0.0;
  double counted_weight_ = 0.0;
  double total_ = 0.0;
  double total_weight_ = 0.0;
};

}  // namespace pmsp::eval
