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

/// Where one gets from the first cell of each row along great circles: in all directions, one step of a row of cells
/// after the other (see kernels::PriorCells). From the row's other cells it is as many columns further on.
std::vector<int> look_table(const PriorGrid& grid);

/// Distance of the samples by which texture is judged (tangent of the angle).
float texture_spacing(int width);

/// Variance below which there is none [gray levels squared].
float texture_variance(const PatchMatchOptions& options);

}  // namespace pmsp
