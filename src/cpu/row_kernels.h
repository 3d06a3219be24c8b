// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <tuple>
#include <type_traits>

#include "confidence.h"
#include "duplicates.h"
#include "fused_point.h"
#include "match.h"
#include "median.h"
#include "plane_prior.h"
#include "ranges.h"
#include "stage.h"
#include "weighted_median.h"

// CPU backend: stages over one row of pixels, compiled for each instruction set. This header is included by code of all
// instruction sets and therefore contains plain data only.
namespace pmsp::cpu {

using kernels::HostViewTypes;

/// Function for row y of a stage; adds to its counts.
template <class Stage>
struct RowOf {
  void (*row)(const Stage& stage, int y, std::int64_t* counts);
};

/// Stages that are compiled for each instruction set.
template <class... Stages>
struct StageList {
  using Rows = std::tuple<RowOf<Stages>...>;
};
using RowStages = StageList<kernels::MedianFilter<HostViewTypes>, kernels::WeightedMedian<HostViewTypes>,
                            kernels::ConsistencyFilter<HostViewTypes>, kernels::FindRanges<HostViewTypes>,
                            kernels::FusePixels<HostViewTypes>, kernels::FreeSpaceTest, kernels::FindMirrored,
                            kernels::ConfirmMirrors, kernels::FindEvidence<HostViewTypes>>;

template <class Stage, class... Stages>
constexpr bool has_rows(StageList<Stages...> /*list*/) {
  return (std::is_same_v<Stage, Stages> || ...);
}

using PatchMatchPass = kernels::PatchMatchPass<HostViewTypes>;

/// Functions of one instruction set.
struct RowKernels {
  RowStages::Rows stages;
  /// Initial planes of row y.
  void (*start_row)(const PatchMatchPass& pass, int y);
  /// Propagation and refinement of the pixels of one colour in row y.
  void (*iterate_row)(const PatchMatchPass& pass, int y, int colour, int iteration, bool rescore);
  /// Round of duplicate removal for the open pixels of row y. `candidates`: bits of the candidates of each, in order;
  /// nullptr = all keyframes in `available` (bits of those with surfels). `remaining`: receives the bits of the pixels
  /// that stay open. Returns their number.
  int (*duplicate_row)(const kernels::DuplicateRound& stage, int y, const std::uint32_t* candidates,
                       std::uint32_t available, std::uint32_t* remaining);
};

}  // namespace pmsp::cpu
