// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "cuda/device_types.h"

// The device's work, each function a kernel or a few on a stream. They throw DeviceError when a launch fails.
namespace pmsp::cuda {

using PatchMatchPass = kernels::PatchMatchPass<DeviceMachine>;

/// Whether this build holds code for the current device.
bool runs_here();

/// Colours with the mask, gray values, or both.
void resize(const ResizeArgs& args, cudaStream_t stream);

/// Averages each row over as many pixels as one equatorial pixel is wide there.
void equalize_rows(const float* gray, float* equalized, int width, int height, cudaStream_t stream);

/// Gray values (0 to 255) on the faces of a cube of 16-bit texels.
void fill_cube(const float* gray, int width, int height, const CubeArgs& cube, cudaStream_t stream);

/// Where patches may be matched: a cube of 8-bit texels, 0 within `radius_px` of a pixel that the mask forbids.
/// `scratch`: a byte a pixel.
void fill_usable_cube(const uchar4* color, int width, int height, double radius_px, unsigned char* scratch,
                      const CubeArgs& cube, cudaStream_t stream);

/// Runs a stage over all its pixels; one of those that src/cuda/stages.cu lists. Adds to `counts` what it counts;
/// nullptr = not wanted.
template <class Stage>
void launch(const Stage& stage, Counts* counts, cudaStream_t stream);

/// The first `count` landmarks.
void splat_landmarks(const kernels::SplatLandmarks<DeviceKeys>& splat, int count, cudaStream_t stream);

void start_pixels(const PatchMatchPass& pass, cudaStream_t stream);
/// `rescore`: planes are there, but not their scores.
void iterate_pixels(const PatchMatchPass& pass, int colour, int iteration, bool rescore, cudaStream_t stream);

/// A round of ownership for all pixels of a keyframe.
void remove_duplicates(const DuplicateArgs& args, cudaStream_t stream);

/// The points that a keyframe makes, in row order (pmsp::kept_points). `scratch`: at least owned_scratch_bytes.
void kept_points(const OwnedArgs& args, void* scratch, std::size_t scratch_bytes, cudaStream_t stream);
std::size_t owned_scratch_bytes(int pixels);

}  // namespace pmsp::cuda
