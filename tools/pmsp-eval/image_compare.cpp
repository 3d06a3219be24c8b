// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/image_compare.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pmsp-eval/ground_truth.h"
#include "pmsp/camera.h"

namespace pmsp::eval {
namespace {

float best_error(float estimate, const Image<float>& truth, int x, int y, int slack_px) {
  float best = std::numeric_limits<float>::infinity();
  for (int dy = -slack_px; dy <= slack_px; ++dy) {
    const int row = std::clamp(y + dy, 0, truth.height() - 1);
    for (int dx = -slack_px; dx <= slack_px; ++dx) {
      const float range = truth(((x + dx) % truth.width() + truth.width()) % truth.width(), row);
      if (is_range(range)) best = std::min(best, std::abs(estimate - range) / range);
    }
  }
  return best;
}

}  // namespace

Image<float> relative_error(const Image<float>& estimate, const Image<float>& truth, int slack_px) {
  Image<float> error(estimate.width(), estimate.height(), std::numeric_limits<float>::quiet_NaN());
  for (int y = 0; y < estimate.height(); ++y) {
    const int truth_y = centre_index(y, estimate.height(), truth.height());
    for (int x = 0; x < estimate.width(); ++x) {
      const int truth_x = centre_index(x, estimate.width(), truth.width());
      if (!is_range(truth(truth_x, truth_y))) continue;
      error(x, y) = best_error(estimate(x, y), truth, truth_x, truth_y, slack_px);
    }
  }
  return error;
}

double row_weight(int y, int height) {
  constexpr double kPi = 3.14159265358979323846;
  return std::sin((y + 0.5) / height * kPi);
}

int columns_within(int reach, int y, int width, int height) {
  return std::min(static_cast<int>(std::lround(reach / row_weight(y, height))), width / 4);
}

Eigen::Vector2i pixel_of(const Eigen::Vector3d& in_cam, int width, int height) {
  const Eigen::Vector2d pixel = pixel_from_bearing(in_cam, width, height);
  return {std::min(static_cast<int>(pixel.x()), width - 1), std::min(static_cast<int>(pixel.y()), height - 1)};
}

}  // namespace pmsp::eval
