// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"

// Launches of stages, one thread per pixel.
namespace pmsp::cuda {
namespace {

constexpr unsigned int kBlockWidth = 32;
constexpr unsigned int kBlockHeight = 2;
constexpr int kBlockThreads = kBlockWidth * kBlockHeight;

/// Small blocks, since some stages need many registers; even smaller ones for few pixels, so that all multiprocessors
/// get some.
dim3 block_for(int width, int height) { return dim3(kBlockWidth, width * height < 1 << 17 ? 1 : kBlockHeight); }

/// Pixel of a thread. Blocks near the poles come first: pixels crowd there, so that some stages take longest for them.
__device__ void pixel_of_thread(int& x, int& y) {
  const unsigned int row = (blockIdx.y & 1U) == 0 ? blockIdx.y / 2 : gridDim.y - 1 - blockIdx.y / 2;
  x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  y = static_cast<int>(row * blockDim.y + threadIdx.y);
}

template <class Stage>
__global__ void stage_kernel(const __grid_constant__ Stage stage, unsigned int* counts) {
  int x = 0;
  int y = 0;
  pixel_of_thread(x, y);
  bool counted[Stage::kCounts + 1] = {};
  if (x < stage.width() && y < stage.height()) stage(kernels::single_pixel(x, y, stage.width()), counted);
  if (counts == nullptr) return;
  for (int i = 0; i < Stage::kCounts; ++i) count_if(counted[i], counts + i);
}

using WeightedMedian = kernels::WeightedMedian<DeviceViewTypes>;

/// Numbers of a thread in shared memory, interleaved with those of its block's other threads.
struct SharedNumbers {
  float* first;
  PMSP_HD float& operator[](int k) const { return first[k * kBlockThreads]; }
};

__global__ void weighted_median_kernel(const __grid_constant__ WeightedMedian stage) {
  __shared__ float inverse_depth[kernels::kMedianSamples * kBlockThreads];
  __shared__ float weight[kernels::kMedianSamples * kBlockThreads];
  int x = 0;
  int y = 0;
  pixel_of_thread(x, y);
  if (x >= stage.width() || y >= stage.height()) return;
  const unsigned int thread = threadIdx.x + blockDim.x * threadIdx.y;
  stage.filter(kernels::single_pixel(x, y, stage.width()), SharedNumbers{inverse_depth + thread},
               SharedNumbers{weight + thread});
}

/// One block per landmark; its threads divide the pixels of each row.
__global__ void splat_kernel(const __grid_constant__ kernels::SplatLandmarks<DeviceKeys> splat) {
  splat(static_cast<int>(blockIdx.x), static_cast<int>(threadIdx.x), static_cast<int>(blockDim.x));
}

}  // namespace

template <class Stage>
void launch(const Stage& stage, Counts* counts, cudaStream_t stream) {
  static_assert(Stage::kCounts <= Counts::kMost, "room for what is counted");
  unsigned int* const of = counts == nullptr ? nullptr : counts->of;
  const dim3 block = block_for(stage.width(), stage.height());
  stage_kernel<Stage><<<image_grid(stage.width(), stage.height(), 1, block), block, 0, stream>>>(stage, of);
  PMSP_CUDA_LAUNCHED();
}

/// Its arrays would fit into registers only with unrolled loops, whose code exceeds the instruction cache of a
/// multiprocessor.
template <>
void launch(const WeightedMedian& stage, Counts* /*counts*/, cudaStream_t stream) {
  const dim3 block(kBlockWidth, kBlockHeight);
  weighted_median_kernel<<<image_grid(stage.width(), stage.height(), 1, block), block, 0, stream>>>(stage);
  PMSP_CUDA_LAUNCHED();
}

template void launch(const kernels::MedianFilter<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::ConsistencyFilter<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::FindRanges<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::FusePixels<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::FreeSpaceTest&, Counts*, cudaStream_t);
template void launch(const kernels::FitTiles&, Counts*, cudaStream_t);
template void launch(const kernels::MeasureTiles&, Counts*, cudaStream_t);
template void launch(const kernels::FindWidePlanes&, Counts*, cudaStream_t);
template void launch(const kernels::ChooseWidePlanes&, Counts*, cudaStream_t);
template void launch(const kernels::FindMirrored&, Counts*, cudaStream_t);
template void launch(const kernels::ConfirmMirrors&, Counts*, cudaStream_t);
template void launch(const kernels::CountMirrored&, Counts*, cudaStream_t);
template void launch(const kernels::SumMirrored&, Counts*, cudaStream_t);
template void launch(const kernels::ChooseMirrors&, Counts*, cudaStream_t);
template void launch(const kernels::FindEvidence<DeviceViewTypes>&, Counts*, cudaStream_t);
template <kernels::PriorStep step>
using PriorStage = kernels::PriorCellStep<DeviceViewTypes, step>;
template void launch(const PriorStage<kernels::PriorStep::kPixels>&, Counts*, cudaStream_t);
template void launch(const PriorStage<kernels::PriorStep::kSupports>&, Counts*, cudaStream_t);
template void launch(const PriorStage<kernels::PriorStep::kSurroundings>&, Counts*, cudaStream_t);
template void launch(const PriorStage<kernels::PriorStep::kCandidates>&, Counts*, cudaStream_t);
template void launch(const PriorStage<kernels::PriorStep::kPlanes>&, Counts*, cudaStream_t);
template void launch(const PriorStage<kernels::PriorStep::kAdoption>&, Counts*, cudaStream_t);
template void launch(const PriorStage<kernels::PriorStep::kChoice>&, Counts*, cudaStream_t);
template void launch(const kernels::PixelPriors<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::ReorderPlanes<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::ScoresWithoutPriors<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::WarpPixels<DeviceViewTypes, DeviceKeys>&, Counts*, cudaStream_t);
template void launch(const kernels::DepthImage<DeviceViewTypes>&, Counts*, cudaStream_t);
template void launch(const kernels::PlaneImage<DeviceViewTypes>&, Counts*, cudaStream_t);

void splat_landmarks(const kernels::SplatLandmarks<DeviceKeys>& splat, int count, cudaStream_t stream) {
  constexpr int kPointThreads = 64;
  if (count == 0) return;
  splat_kernel<<<static_cast<unsigned>(count), kPointThreads, 0, stream>>>(splat);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
