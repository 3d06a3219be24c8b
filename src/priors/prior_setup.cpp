// SPDX-License-Identifier: BSD-2-Clause
#include "priors/prior_setup.h"

#include <algorithm>
#include <cmath>

namespace pmsp {

PriorGrid::PriorGrid(int width, int height)
    : columns(std::min(kernels::kPriorColumns, width / 2)), rows(std::min(kernels::kPriorColumns / 2, height / 2)) {}

std::vector<int> look_table(const PriorGrid& grid) {
  std::vector<int> looks;
  const int steps = kernels::look_steps(grid.rows);
  for (int row = 0; row < grid.rows; ++row) {
    for (int direction = 0; direction < kernels::kPriorDirections; ++direction) {
      for (int step = 1; step <= steps; ++step) {
        looks.push_back(kernels::looked_at(row, direction, step, grid.columns, grid.rows));
      }
    }
  }
  return looks;
}

float texture_spacing(int width) {
  return static_cast<float>(std::tan(kernels::kTexturePixels * 2.0 * kernels::kPi / width));
}

float texture_variance(const PatchMatchOptions& options) {
  return static_cast<float>(options.fine_patch_contrast * options.fine_patch_contrast);
}

}  // namespace pmsp
