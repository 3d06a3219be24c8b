// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/image_compare.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "elementary.h"
#include "pmsp-eval/ground_truth.h"
#include "pmsp/camera.h"

namespace pmsp::eval {
namespace {

/// Of the true ranges around a pixel, that with the least relative error; NaN = all unknown.
float best_range(float estimate, const Image<float>& truth, int x, int y, int slack_px) {
  float best = std::numeric_limits<float>::quiet_NaN();
  float least = std::numeric_limits<float>::infinity();
  for (int dy = -slack_px; dy <= slack_px; ++dy) {
    const int row = std::clamp(y + dy, 0, truth.height() - 1);
    for (int dx = -slack_px; dx <= slack_px; ++dx) {
      const float range = truth(((x + dx) % truth.width() + truth.width()) % truth.width(), row);
      if (!is_range(range)) continue;
      const float error = std::abs(estimate - range) / range;
      if (error < least || std::isnan(best)) {
        best = range;
        least = error;
      }
    }
  }
  return best;
}

}  // namespace

float range_at(const Image<float>& truth, double x, double y) {
  constexpr float kOneSurface = 1.05F;  // maximum ratio of the ranges of four pixels
  const auto left = static_cast<int>(std::floor(x - 0.5));
  const auto above = static_cast<int>(std::floor(y - 0.5));
  const double right_share = x - 0.5 - left;
  const double below_share = y - 0.5 - above;
  float range[4];
  for (int i = 0; i < 4; ++i) {
    const int column = left + i % 2;
    range[i] = truth((column + truth.width()) % truth.width(), std::clamp(above + i / 2, 0, truth.height() - 1));
  }
  const auto [nearest, farthest] = std::minmax_element(std::begin(range), std::end(range));
  if (!std::all_of(std::begin(range), std::end(range), is_range) || *farthest > kOneSurface * *nearest) {
    return range[(right_share < 0.5 ? 0 : 1) + (below_share < 0.5 ? 0 : 2)];
  }
  const auto between = [](double share, double a, double b) { return (1.0 - share) * a + share * b; };
  const double inverse = between(
      below_share, between(right_share, 1.0 / static_cast<double>(range[0]), 1.0 / static_cast<double>(range[1])),
      between(right_share, 1.0 / static_cast<double>(range[2]), 1.0 / static_cast<double>(range[3])));
  return static_cast<float>(1.0 / inverse);
}

Image<float> true_ranges(const Image<float>& estimate, const Image<float>& truth, int slack_px) {
  Image<float> ranges(estimate.width(), estimate.height(), std::numeric_limits<float>::quiet_NaN());
  for (int y = 0; y < estimate.height(); ++y) {
    const int truth_y = centre_index(y, estimate.height(), truth.height());
    for (int x = 0; x < estimate.width(); ++x) {
      const int truth_x = centre_index(x, estimate.width(), truth.width());
      if (!is_range(truth(truth_x, truth_y))) continue;
      if (slack_px > 0) {
        ranges(x, y) = best_range(estimate(x, y), truth, truth_x, truth_y, slack_px);
      } else {
        const float range = range_at(truth, (x + 0.5) * truth.width() / estimate.width(),
                                     (y + 0.5) * truth.height() / estimate.height());
        if (is_range(range)) ranges(x, y) = range;
      }
    }
  }
  return ranges;
}

Image<float> relative_error(const Image<float>& estimate, const Image<float>& truth, int slack_px) {
  Image<float> error = true_ranges(estimate, truth, slack_px);
  for (std::size_t i = 0; i < error.size(); ++i) {
    float& range = error.pixels()[i];
    range = std::abs(estimate.pixels()[i] - range) / range;
  }
  return error;
}

double row_weight(int y, int height) { return std::sin((y + 0.5) / height * kernels::kPi); }

int columns_within(int reach, int y, int width, int height) {
  return std::min(static_cast<int>(std::lround(reach / row_weight(y, height))), width / 4);
}

Eigen::Vector2i pixel_of(const Eigen::Vector3d& in_cam, int width, int height) {
  const Eigen::Vector2d pixel = pixel_from_bearing(in_cam, width, height);
  return {std::min(static_cast<int>(pixel.x()), width - 1), std::min(static_cast<int>(pixel.y()), height - 1)};
}

}  // namespace pmsp::eval
