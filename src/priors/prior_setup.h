// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "patchmatch/match_setup.h"
#include "plane_prior.h"
#include "pmsp/types.h"
#include "processor.h"

// Input of the plane priors, for all backends.
namespace pmsp {

/// Number of cells on the sphere.
struct PriorGrid {
  PriorGrid(int width, int height);

  std::size_t cells() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }

  int columns, rows;
};

/// Cells along great circles from the first cell of each row, in all directions, one step per height of a cell (see
/// kernels::PriorCells). From other cells of the row, columns are shifted.
std::vector<int> great_circle_table(const PriorGrid& grid);

/// Distance of the samples that measure texture (tangent of the angle).
float texture_spacing(int width);

/// Planes of the cells from a depth image (Keyframe::prior_depth), 0 = none: each fitted to one surface in and around
/// its cell. `unit`: of the planes [the depths' unit].
std::vector<kernels::Vec3<float>> planes_from_prior_depth(ImageView<const float> depth, double unit,
                                                          const PriorGrid& grid);

/// Vector from a camera to another one, in the frame of the first.
kernels::Vec3<float> baseline(const kernels::Rigid& other_from_first);

/// Baselines of a keyframe's source views.
template <class Cube>
kernels::Baselines baselines_of(const kernels::MatchArgs<Cube>& matching) {
  kernels::Baselines baselines{};
  for (int k = 0; k < matching.num_views; ++k) {
    baselines.to[baselines.count++] = baseline(matching.views[k].view_from_ref);
  }
  return baselines;
}

/// Image evidence of each pixel's depth (kernels/depth_evidence.h), common to all passes with the same source views.
struct EvidenceMap {
  Array<float> variance, certainty;
  kernels::Baselines baselines{};

  bool matches(const kernels::Baselines& others) const {
    if (!variance || baselines.count != others.count) return false;
    for (int k = 0; k < others.count; ++k) {
      const kernels::Vec3<float>&a = baselines.to[k], &b = others.to[k];
      if (a.x != b.x || a.y != b.y || a.z != b.z) return false;
    }
    return true;
  }
};

template <class Processor, class Cube>
EvidenceMap find_evidence(Processor& on, const Cube& image, const kernels::Baselines& baselines) {
  using ViewTypes = typename Processor::ViewTypes;
  const kernels::GridView grid = on.grid();
  const std::size_t pixels = static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height);
  EvidenceMap evidence{on.template array<float>(pixels), on.template array<float>(pixels), baselines};
  on.launch(kernels::FindEvidence<ViewTypes>{image, grid, baselines, texture_spacing(grid.width),
                                             evidence.variance.get(), evidence.certainty.get()},
            nullptr);
  return evidence;
}

/// Distances at which cells adopt planes [cells], in this order: long ones first, so that a plane reaches all cells.
constexpr int kPriorStrides[] = {16, 8, 4, 2, 1};

/// Prior planes of a map's pixels. `image`: gray values; `great_circles`, `prior_depth_planes`: great_circle_table and
/// planes_from_prior_depth (or nullptr), in memory of the processor (processor.h). `noise`: see image_noise.
template <class Processor, class Map, class Cube, class Planes>
void find_plane_priors(Processor& on, const Array<int>& great_circles,
                       const Array<kernels::Vec3<float>>& prior_depth_planes, const Map& map, const Cube& image,
                       float noise, const EvidenceMap& evidence, const kernels::PlaneLimits& limits, const Planes& to) {
  using ViewTypes = typename Processor::ViewTypes;
  using kernels::PriorStep;
  const PriorGrid size(map.width, map.height);
  const auto supports = on.template array<kernels::Vec3<float>>(size.cells());
  const auto errors = on.template array<float>(size.cells());
  const auto uncertain = on.template array<unsigned char>(size.cells());
  const auto around = on.template array<kernels::NearestSupports>(size.cells());
  const auto pixels = on.template array<kernels::SupportPixel>(size.cells() * Processor::kThreadsPerPriorCell);
  const auto candidates = on.template array<kernels::PriorPlane>(size.cells() * Processor::kThreadsPerPriorCell);
  auto before = on.template array<kernels::PriorPlane>(size.cells());
  auto found = on.template array<kernels::PriorPlane>(size.cells());
  kernels::PriorCells<ViewTypes> cells{};
  cells.map = map;
  cells.image = image;
  cells.grid = on.grid();
  cells.baselines = evidence.baselines;
  cells.spacing = texture_spacing(map.width);
  cells.variance = evidence.variance.get();
  cells.certainty = evidence.certainty.get();
  cells.min_variance = textured_variance(noise);
  cells.far_variance = far_variance(noise);
  cells.limits = limits;
  cells.columns = size.columns;
  cells.rows = size.rows;
  cells.great_circles = great_circles.get();
  cells.prior_depth_planes = prior_depth_planes.get();
  cells.supports = supports.get();
  cells.errors = errors.get();
  cells.uncertain = uncertain.get();
  cells.around = around.get();
  cells.found = found.get();
  cells.pixels = pixels.get();
  cells.candidates = candidates.get();
  cells.threads = Processor::kThreadsPerPriorCell;
  on.launch(kernels::PriorCellStep<ViewTypes, PriorStep::kPixels>{cells}, nullptr);
  on.launch(kernels::PriorCellStep<ViewTypes, PriorStep::kSupports>{cells}, nullptr);
  on.launch(kernels::PriorCellStep<ViewTypes, PriorStep::kSurroundings>{cells}, nullptr);
  on.launch(kernels::PriorCellStep<ViewTypes, PriorStep::kCandidates>{cells}, nullptr);
  on.launch(kernels::PriorCellStep<ViewTypes, PriorStep::kPlanes>{cells}, nullptr);
  for (const int stride : kPriorStrides) {
    std::swap(before, found);
    cells.previous = before.get();
    cells.found = found.get();
    cells.stride = stride;
    on.launch(kernels::PriorCellStep<ViewTypes, PriorStep::kAdoption>{cells}, nullptr);
    on.launch(kernels::PriorCellStep<ViewTypes, PriorStep::kChoice>{cells}, nullptr);
  }
  on.launch(kernels::PixelPriors<ViewTypes>{cells, to}, nullptr);
}

}  // namespace pmsp
