// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include "agreement.h"
#include "confidence.h"
#include "fused_point.h"
#include "ownership.h"
#include "patchmatch.h"
#include "plane_prior.h"
#include "sight.h"

// The CPU backend: the kernels over one row of pixels, once for each instruction set. This header is included by code
// of every instruction set and therefore holds plain data only.
namespace pmsp::cpu {

/// Tables of a SphereGrid.
struct GridTables {
  int width, height;
  const float* sin_lon[3];  ///< even columns, odd columns, all columns
  const float* cos_lon[3];
  const float* sin_lat;
  const float* cos_lat;
};

/// A map of planes in checkerboard order (SphereGrid).
struct PlaneArrays {
  float* x;
  float* y;
  float* z;
  float* score;
};
struct ConstPlaneArrays {
  const float* x;
  const float* y;
  const float* z;
};

/// A keyframe's match: everything that a row needs.
struct MatchJob {
  kernels::Matching<kernels::CubeView> matching;
  GridTables grid;
  PlaneArrays planes;
  const ConstPlaneArrays* candidates;  ///< proposals of the initialiser; the zero plane proposes nothing
  int num_candidates;
  ConstPlaneArrays prior;  ///< planes that pixels without texture prefer; nullptr = none
  const float* usable;     ///< checkerboard order, 0 = masked; nullptr = all
};

/// Median filter of a depth map, rows of `width` floats.
struct MedianJob {
  int width, height;
  const float* depth;
  const float* score;
  float max_relative_deviation;
  float min_score;
  float* filtered;  ///< depth or 0
};

/// Comparison of a keyframe's surface with another keyframe's map.
struct CompareJob {
  GridTables grid;
  const float* depth;  ///< of the first keyframe
  kernels::PlaneMapView other;
  kernels::Rigid other_from_first;
};

/// What compare_row writes for the pixels of one row; room for `width` elements each. See kernels::Agreement.
struct CompareRow {
  float* closeness;
  float* implied_depth;
  float* parallax_gain;
  std::int32_t* index;
};

/// Comparison of a keyframe's planes with those around them.
struct RoughnessJob {
  GridTables grid;
  const float* depth;
  kernels::PlaneMapView planes;
  float* roughness;  ///< mean deviation, rows of `width` floats
};

/// What fuse_row writes, in row order.
struct FusedArrays {
  std::uint32_t* surfels;
  std::uint32_t* details;
  std::uint8_t* standings;
  std::uint8_t* agree;
  int agree_bytes;  ///< of each pixel, the lowest byte first
};

/// How much texture there is around each pixel.
struct VarianceJob {
  kernels::CubeView image;
  GridTables grid;
  float spacing;    ///< of the samples (tangent of the angle)
  float* variance;  ///< rows of `width` floats
};

/// One instruction set's functions.
struct RowKernels {
  /// The first planes of row y: a random one and the initialiser's candidates.
  void (*start_row)(const MatchJob& job, int y);
  /// Propagation and refinement of the pixels of one colour in row y. `rescore`: planes are there, but not their
  /// scores.
  void (*iterate_row)(const MatchJob& job, int y, int colour, int iteration, bool rescore);
  void (*median_row)(const MedianJob& job, int y);
  void (*compare_row)(const CompareJob& job, int y, const CompareRow& out);
  void (*roughness_row)(const RoughnessJob& job, int y);
  void (*variance_row)(const VarianceJob& job, int y);
  void (*fuse_row)(const kernels::FusePixels<kernels::PlaneMapView>& stage, int y, const FusedArrays& to);
  void (*judge_row)(const kernels::Eligibility& stage, int y, std::uint8_t* standings);
  /// A round for the open pixels of row y. `ask`: for each of them, in order, bits of the keyframes whose say still
  /// matters; nullptr: that of all in `there`. `standings` of the row: after the round. `still`: the bits for those
  /// that are open then; returns their number.
  int (*own_row)(const kernels::OwnershipRound& stage, int y, const std::uint32_t* ask, std::uint32_t there,
                 std::uint8_t* standings, std::uint32_t* still);
};

}  // namespace pmsp::cpu
