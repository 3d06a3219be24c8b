// SPDX-License-Identifier: BSD-2-Clause
#include "priors/prior_setup.h"

#include <algorithm>
#include <cmath>

namespace pmsp {

PriorGrid::PriorGrid(int width, int height)
    : columns(std::min(kernels::kPriorColumns, width / 2)), rows(std::min(kernels::kPriorColumns / 2, height / 2)) {}

std::vector<int> great_circle_table(const PriorGrid& grid) {
  std::vector<int> great_circles;
  const int steps = kernels::great_circle_steps(grid.rows);
  const double lon = (0.5 / grid.columns - 0.5) * 2.0 * kernels::kPi;
  const auto right = kernels::tangent_right(std::sin(lon), std::cos(lon));
  for (int row = 0; row < grid.rows; ++row) {
    const double lat = (0.5 - (row + 0.5) / grid.rows) * kernels::kPi;
    const auto center = kernels::bearing(std::sin(lon), std::cos(lon), std::sin(lat), std::cos(lat));
    const auto down = kernels::tangent_down(std::sin(lon), std::cos(lon), std::sin(lat), std::cos(lat));
    for (int direction = 0; direction < kernels::kPriorDirections; ++direction) {
      const double turn = 2.0 * kernels::kPi * direction / kernels::kPriorDirections;
      const auto along = fma(std::cos(turn), right, std::sin(turn) * down);
      for (int step = 1; step <= steps; ++step) {
        const double angle = kernels::kPi * step / grid.rows;
        const auto at = fma(std::cos(angle), center, std::sin(angle) * along);
        const kernels::Vec3<float> to{static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z)};
        great_circles.push_back(kernels::pixel_index(to, grid.columns, grid.rows));
      }
    }
  }
  return great_circles;
}

float texture_spacing(int width) {
  return static_cast<float>(std::tan(kernels::kTexturePixels * 2.0 * kernels::kPi / width));
}

kernels::Vec3<float> baseline(const kernels::Rigid& other_from_first) {
  const kernels::Vec3<float> t = kernels::translation<float>(other_from_first);
  const float square_scale = other_from_first.r[0] * other_from_first.r[0] +
                             other_from_first.r[1] * other_from_first.r[1] +
                             other_from_first.r[2] * other_from_first.r[2];
  return (-1.0F / square_scale) * rotate_back(other_from_first, t);
}

}  // namespace pmsp
