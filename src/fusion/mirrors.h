// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "ownership.h"
#include "processor.h"

namespace pmsp {

/// What a keyframe's mirrors are kept in while points are judged.
struct Mirrors {
  Array<kernels::WidePlane> planes;
  Array<std::uint32_t> evidence, confirmed;
};

/// Finds the mirrors that a keyframe sees (kernels/mirror.h), and lets `judge` know of them, which has the keyframe's
/// points and its viewers by now. `from_viewers`: from each viewer's frame into the keyframe's.
template <class Processor>
Mirrors find_mirrors(Processor& on, const std::vector<kernels::Rigid>& from_viewers, kernels::Eligibility& judge) {
  if (judge.count < 2) return {};  // a mirror image wants two witnesses
  const kernels::GridView grid = on.grid();
  const int cells = grid.width / kernels::kRangeCell * (grid.height / kernels::kRangeCell);
  const auto found = on.template array<kernels::WidePlane>(kernels::kFields);
  const auto counts = on.template array<kernels::MirrorCounts>(kernels::kFields);
  const auto words = [&] { return on.template array<std::uint32_t>(static_cast<std::size_t>(cells)); };
  Mirrors mirrors{on.template array<kernels::WidePlane>(kernels::kWidePlanes), words(), words()};
  kernels::WidePlane* const planes = mirrors.planes.get();
  std::uint32_t* const evidence = mirrors.evidence.get();
  std::uint32_t* const confirmed = mirrors.confirmed.get();
  on.launch(kernels::FindWidePlanes{judge.surfels, grid, found.get()}, nullptr);
  on.launch(kernels::ChooseWidePlanes{found.get(), planes}, nullptr);
  kernels::FindMirrored behind{};
  kernels::ConfirmMirrors front{};
  behind.surfels = judge.surfels;
  behind.grid = front.grid = grid;
  behind.count = front.count = judge.count;
  behind.limits = judge.limits;
  behind.planes = front.planes = planes;
  behind.evidence = evidence;
  front.evidence = evidence;
  behind.confirmed = front.confirmed = confirmed;
  kernels::ChooseMirrors choice{};
  choice.counts = counts.get();
  choice.cells = cells;
  choice.planes = planes;
  choice.viewer_count = judge.count;
  for (int k = 0; k < judge.count; ++k) {
    const kernels::Rigid& from_viewer = from_viewers[static_cast<std::size_t>(k)];
    choice.viewers[k] = {from_viewer.t[0], from_viewer.t[1], from_viewer.t[2]};
    behind.viewers[k] = judge.viewers[k];
    front.viewers[k] = {judge.viewers[k].ranges, from_viewer};
  }
  on.launch(behind, nullptr);
  on.launch(front, nullptr);
  on.launch(kernels::CountMirrored{grid, evidence, confirmed, counts.get()}, nullptr);
  on.launch(choice, nullptr);
  judge.mirrors = {planes, evidence, confirmed};
  return mirrors;
}

}  // namespace pmsp
