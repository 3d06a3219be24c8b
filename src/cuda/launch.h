// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cuda/device_types.h"

// Work of the device; each function launches one or a few kernels on a stream. They throw DeviceError if a launch
// fails.
namespace pmsp::cuda {

using PatchMatchPass = kernels::PatchMatchPass<DeviceViewTypes>;

/// Whether this build contains code for the current device.
bool runs_here();

/// Colours with the mask, gray values, or both.
void resize(const ResizeArgs& args, cudaStream_t stream);

/// Averages each row over as many pixels as one equatorial pixel is wide there.
void equalize_rows(const float* gray, float* equalized, int width, int height, cudaStream_t stream);

/// Gray values (0 to 255) on the faces of a cube of 16-bit texels.
void fill_cube(const float* gray, int width, int height, const CubeArgs& cube, cudaStream_t stream);

/// Where patches may be matched: a cube of 8-bit texels, 0 within `radius_px` of a masked pixel. `scratch`: a byte per
/// pixel.
void fill_matchable_cube(const uchar4* color, int width, int height, double radius_px, unsigned char* scratch,
                         const CubeArgs& cube, cudaStream_t stream);

/// Runs a stage over all its pixels; instantiated in src/cuda/stages.cu. Adds to `counts`; nullptr = not needed.
template <class Stage>
void launch(const Stage& stage, Counts* counts, cudaStream_t stream);

/// Splats the first `count` landmarks.
void splat_landmarks(const kernels::SplatLandmarks<DeviceKeys>& splat, int count, cudaStream_t stream);

void start_pixels(const PatchMatchPass& pass, cudaStream_t stream);
/// `rescore`: scores are from the previous pass: recompute them.
void iterate_pixels(const PatchMatchPass& pass, int colour, int iteration, bool rescore, cudaStream_t stream);

/// Round of duplicate removal for all pixels of a keyframe.
void remove_duplicates(const DuplicateArgs& args, cudaStream_t stream);

/// Kept points of a keyframe, in row order (pmsp::extract_points). `scratch`: at least emit_scratch_bytes.
void extract_points(const EmitArgs& args, void* scratch, std::size_t scratch_bytes, cudaStream_t stream);
std::size_t emit_scratch_bytes(int pixels);

}  // namespace pmsp::cuda
