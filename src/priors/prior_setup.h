// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "plane_prior.h"
#include "pmsp/options.h"

// What the backends' plane priors start from.
namespace pmsp {

/// Number of cells that the sphere is divided into.
struct PriorGrid {
  PriorGrid(int width, int height);

  std::size_t cells() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }

  int columns, rows;
};

/// kernels::looked_at of all rows, directions and steps.
std::vector<int> look_table(const PriorGrid& grid);

/// Distance of the samples by which texture is judged (tangent of the angle).
float texture_spacing(int width);

/// Variance below which there is none [gray levels squared].
float texture_variance(const PatchMatchOptions& options);

}  // namespace pmsp
