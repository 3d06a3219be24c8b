// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"
#include "cuda/shared_patch.h"

// PatchMatch, one thread per pixel. Pixels of a colour are contiguous in memory, and so are a warp's accesses.
namespace pmsp::cuda {
namespace {

using PixelContext = kernels::PixelContext<float, SharedPatch>;

// Small blocks: the pixels of one colour of a small depth map fill hardly more than one wave of blocks.
constexpr int kBlockWidth = 32;
constexpr int kBlockHeight = kPatchThreads / kBlockWidth;
constexpr int kMinBlocks = 12;  ///< per multiprocessor: 768 threads with 80 registers each

/// Pixel of a thread. Returns false outside the image.
__device__ bool batch_of_thread(const PatchMatchPass& pass, int colour, kernels::PixelBatch<float>& batch) {
  const int half = pass.grid.width / 2;
  const int k = static_cast<int>(blockIdx.x * kBlockWidth + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * kBlockHeight + threadIdx.y);
  const int x = 2 * k + ((y + colour) & 1);
  batch = {y, colour, k, half - k, kernels::ring_index(pass.grid.width, y, colour), x, y * pass.grid.width + x};
  return k < half && y < pass.grid.height;
}

__global__ void __launch_bounds__(kPatchThreads, kMinBlocks) start_kernel(const __grid_constant__ PatchMatchPass pass) {
  __shared__ __half2 samples[kernels::kPatchSamples * kPatchThreads];
  kernels::PixelBatch<float> batch;
  if (!batch_of_thread(pass, static_cast<int>(blockIdx.z), batch)) return;
  PixelContext context{{}, SharedPatch(samples)};
  pass.start(context, batch);
}

__global__ void __launch_bounds__(kPatchThreads, kMinBlocks)
    iterate_kernel(const __grid_constant__ PatchMatchPass pass, int colour, int iteration, bool rescore) {
  __shared__ __half2 samples[kernels::kPatchSamples * kPatchThreads];
  kernels::PixelBatch<float> batch;
  if (!batch_of_thread(pass, colour, batch)) return;
  PixelContext context{{}, SharedPatch(samples)};
  pass.iterate(context, batch, iteration, rescore);
}

dim3 colour_grid(const kernels::GridView& grid, int colours) {
  return dim3(static_cast<unsigned>(blocks(grid.width / 2, kBlockWidth)),
              static_cast<unsigned>(blocks(grid.height, kBlockHeight)), static_cast<unsigned>(colours));
}

}  // namespace

bool runs_here() {
  cudaFuncAttributes attributes{};
  const cudaError_t result = cudaFuncGetAttributes(&attributes, iterate_kernel);
  cudaGetLastError();  // clears the error
  return result == cudaSuccess;
}

void start_pixels(const PatchMatchPass& pass, cudaStream_t stream) {
  start_kernel<<<colour_grid(pass.grid, 2), dim3(kBlockWidth, kBlockHeight), 0, stream>>>(pass);
  PMSP_CUDA_LAUNCHED();
}

void iterate_pixels(const PatchMatchPass& pass, int colour, int iteration, bool rescore, cudaStream_t stream) {
  iterate_kernel<<<colour_grid(pass.grid, 1), dim3(kBlockWidth, kBlockHeight), 0, stream>>>(pass, colour, iteration,
                                                                                            rescore);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
