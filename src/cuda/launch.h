// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cuda/device_types.h"

// The device's work, each function a kernel or a few on a stream. They throw DeviceError when a launch fails.
namespace pmsp::cuda {

/// Whether this build holds code for the current device.
bool runs_here();

/// Colours, gray values and the mask at the size of the depth maps.
void resize(const ResizeArgs& args, cudaStream_t stream);

/// Averages each row over as many pixels as one equatorial pixel is wide there.
void equalize_rows(const float* gray, float* equalized, int width, int height, cudaStream_t stream);

/// Gray values (0 to 255) on the faces of a cube of 16-bit texels.
void fill_cube(const float* gray, int width, int height, const CubeArgs& cube, cudaStream_t stream);

/// Where patches may be matched: a cube of 8-bit texels, 0 within `radius_px` of a pixel that the mask forbids.
/// `scratch`: a byte a pixel.
void fill_usable_cube(const uchar4* color, int width, int height, double radius_px, unsigned char* scratch,
                      const CubeArgs& cube, cudaStream_t stream);

/// Spreads landmarks over their neighbourhood; `keys` are all ~0 before.
void splat_points(const SplatArgs& args, cudaStream_t stream);

/// Moves the previous map's pixels; `keys` are all ~0 before.
void warp_planes(const WarpArgs& args, cudaStream_t stream);

/// Planes for surfaces without texture.
void find_priors(const PriorArgs& args, cudaStream_t stream);

void start_pixels(const MatchArgs& args, cudaStream_t stream);
/// `rescore`: planes are there, but not their scores.
void iterate_pixels(const MatchArgs& args, int colour, int iteration, bool rescore, cudaStream_t stream);

/// PatchMatch's result, from checkerboard to row order.
void to_rows(const cpu::GridTables& grid, const float4* state, float4* raw, cudaStream_t stream);

/// The other way round, for a pass that goes on.
void from_rows(const cpu::GridTables& grid, const float4* raw, float4* state, cudaStream_t stream);

/// Planes and scores as a depth map.
void export_planes(const cpu::GridTables& grid, const float4* planes, const MapArrays& out, cudaStream_t stream);

void median_pixels(const MedianArgs& args, cudaStream_t stream);

void filter_pixels(const ConsistencyArgs& args, cudaStream_t stream);

/// The point of each pixel of a map (pmsp::fuse_pixels).
void make_surfels(const SurfelArgs& args, cudaStream_t stream);

/// How far a keyframe has seen (pmsp::sight_map).
void find_sight(const SightArgs& args, cudaStream_t stream);

/// Which points are eligible (pmsp::judge).
void judge_pixels(const JudgeArgs& args, cudaStream_t stream);

/// A round that decides which pixels make a point (pmsp::ownership_round).
void own_pixels(const OwnershipArgs& args, cudaStream_t stream);

/// The points that a keyframe makes, in row order (pmsp::owned_points). `scratch`: at least owned_scratch_bytes.
void owned_points(const OwnedArgs& args, void* scratch, std::size_t scratch_bytes, cudaStream_t stream);
std::size_t owned_scratch_bytes(int pixels);

}  // namespace pmsp::cuda
