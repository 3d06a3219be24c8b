// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "duplicates.h"
#include "processor.h"

namespace pmsp {

/// Mirrors of a keyframe during the free-space test.
struct Mirrors {
  Array<kernels::WidePlane> planes;
  Array<std::uint32_t> evidence, confirmed;
};

/// Plane of each tile of a keyframe's points (kernels/wide_plane.h).
template <class Processor>
Array<kernels::WidePlane> wide_planes(Processor& on, const std::uint32_t* surfels) {
  constexpr std::size_t kTileShares = std::size_t{kernels::kTiles} * kernels::kTileSide;
  const kernels::GridView grid = on.grid();
  const auto found = on.template array<kernels::WidePlane>(kernels::kTiles);
  const auto supports = on.template array<kernels::TileSupport>(kTileShares);
  auto before = on.template array<kernels::TileSums>(kTileShares);
  auto sums = on.template array<kernels::TileSums>(kTileShares);
  for (const float& reach : kernels::kTileReach) {
    std::swap(before, sums);
    const bool is_first = &reach == kernels::kTileReach;
    on.launch(kernels::FitTiles{surfels, grid, is_first ? nullptr : before.get(), reach, sums.get()}, nullptr);
  }
  on.launch(kernels::MeasureTiles{surfels, grid, sums.get(), supports.get()}, nullptr);
  on.launch(kernels::FindWidePlanes{grid, sums.get(), supports.get(), found.get()}, nullptr);
  return found;
}

/// Finds the mirrors of a keyframe (kernels/mirror.h) and adds them to `test`, which has the keyframe's points and
/// viewers already. `from_viewers`: from each viewer's frame into the keyframe's.
template <class Processor>
Mirrors find_mirrors(Processor& on, const std::vector<kernels::Rigid>& from_viewers, kernels::FreeSpaceTest& test) {
  if (test.count < 2) return {};  // a mirror image needs two viewers
  const kernels::GridView grid = on.grid();
  const int cells = grid.width / kernels::kRangeCell * (grid.height / kernels::kRangeCell);
  const int parts = kernels::kCountColumns * (grid.height / kernels::kRangeCell);
  const auto found = wide_planes(on, test.surfels);
  const auto counts = on.template array<kernels::MirrorCounts>(static_cast<std::size_t>(parts));
  const auto sums = on.template array<kernels::MirrorCounts>(kernels::kMirrorSums);
  const auto words = [&] { return on.template array<std::uint32_t>(static_cast<std::size_t>(cells)); };
  Mirrors mirrors{on.template array<kernels::WidePlane>(kernels::kWidePlanes), words(), words()};
  kernels::WidePlane* const planes = mirrors.planes.get();
  std::uint32_t* const evidence = mirrors.evidence.get();
  std::uint32_t* const confirmed = mirrors.confirmed.get();
  on.launch(kernels::ChooseWidePlanes{found.get(), planes}, nullptr);
  kernels::FindMirrored behind{};
  kernels::ConfirmMirrors front{};
  behind.surfels = test.surfels;
  behind.grid = front.grid = grid;
  behind.count = front.count = test.count;
  behind.limits = test.limits;
  behind.planes = front.planes = planes;
  behind.evidence = evidence;
  front.evidence = evidence;
  behind.confirmed = front.confirmed = confirmed;
  kernels::ChooseMirrors choice{};
  choice.sums = sums.get();
  choice.cells = cells;
  choice.planes = planes;
  choice.viewer_count = test.count;
  for (int k = 0; k < test.count; ++k) {
    const kernels::Rigid& from_viewer = from_viewers[static_cast<std::size_t>(k)];
    choice.viewers[k] = {from_viewer.t[0], from_viewer.t[1], from_viewer.t[2]};
    behind.viewers[k] = test.viewers[k];
    front.viewers[k] = {test.viewers[k].ranges, from_viewer};
  }
  on.launch(behind, nullptr);
  on.launch(front, nullptr);
  on.launch(kernels::CountMirrored{grid, evidence, confirmed, counts.get()}, nullptr);
  on.launch(kernels::SumMirrored{counts.get(), parts, sums.get()}, nullptr);
  on.launch(choice, nullptr);
  test.mirrors = {planes, evidence, confirmed};
  return mirrors;
}

}  // namespace pmsp
