// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "plane_prior.h"
#include "pmsp/image.h"
#include "pmsp/options.h"
#include "processor.h"

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

/// The cells' planes by a depth image (Keyframe::prior_depth), 0 = none: each through the depths of one surface in and
/// around the cell. `unit`: of the planes [the depths' unit].
std::vector<kernels::Vec3<float>> given_planes(ImageView<const float> depth, double unit, const PriorGrid& grid);

/// The priors of a map's pixels. `image`: gray values; `looks`, `given`: the look_table and given_planes (or nullptr),
/// where the processor (processor.h) keeps its arrays.
template <class Processor, class Map, class Cube, class Planes>
void find_plane_priors(Processor& on, const Array<int>& looks, const Array<kernels::Vec3<float>>& given, const Map& map,
                       const Cube& image, const kernels::PlaneLimits& limits, const PatchMatchOptions& options,
                       const Planes& to) {
  using kernels::PriorStep;
  const PriorGrid size(map.width, map.height);
  const auto variance =
      on.template array<float>(static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height));
  const auto supports = on.template array<kernels::Vec3<float>>(size.cells());
  const auto textureless = on.template array<unsigned char>(size.cells());
  const auto around = on.template array<kernels::Surroundings>(size.cells());
  const auto found = on.template array<kernels::PriorPlane>(size.cells());
  const auto chosen = on.template array<kernels::PriorPlane>(size.cells());
  const kernels::PriorCells<Map> cells{
      map,         on.grid(),   variance.get(), texture_variance(options), limits,       size.columns, size.rows,
      looks.get(), given.get(), supports.get(), textureless.get(),         around.get(), found.get(),  chosen.get()};
  on.launch(
      kernels::TextureVariance<typename Processor::Views>{image, on.grid(), texture_spacing(map.width), variance.get()},
      nullptr);
  on.launch(kernels::PriorCellStep<Map, PriorStep::kSupports>{cells}, nullptr);
  on.launch(kernels::PriorCellStep<Map, PriorStep::kPlanes>{cells}, nullptr);
  on.launch(kernels::PriorCellStep<Map, PriorStep::kChoice>{cells}, nullptr);
  on.launch(kernels::PixelPriors<typename Processor::Views>{cells, to}, nullptr);
}

}  // namespace pmsp
