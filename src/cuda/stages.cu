// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"

// Launches stages, a thread for each pixel.
namespace pmsp::cuda {
namespace {

template <class Stage>
__global__ void stage_kernel(const __grid_constant__ Stage stage, unsigned int* counts) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  bool counted[Stage::kCounts + 1] = {};
  if (x < stage.width() && y < stage.height()) stage(kernels::place_of(x, y, stage.width()), counted);
  if (counts == nullptr) return;
  for (int i = 0; i < Stage::kCounts; ++i) count_if(counted[i], counts + i);
}

/// A block a landmark; the threads share its rows' pixels.
__global__ void splat_kernel(const __grid_constant__ kernels::SplatLandmarks<DeviceKeys> splat) {
  splat(static_cast<int>(blockIdx.x), static_cast<int>(threadIdx.x), static_cast<int>(blockDim.x));
}

}  // namespace

template <class Stage>
void launch(const Stage& stage, Counts* counts, cudaStream_t stream) {
  static_assert(Stage::kCounts <= Counts::kMost, "room for what is counted");
  unsigned int* const of = counts == nullptr ? nullptr : counts->of;
  stage_kernel<Stage><<<image_grid(stage.width(), stage.height()), kImageBlock, 0, stream>>>(stage, of);
  PMSP_CUDA_LAUNCHED();
}

template void launch(const kernels::MedianFilter<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::WeightedMedian<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::ConsistencyFilter<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::FindRanges<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::FusePixels<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::Eligibility&, Counts*, cudaStream_t);
template void launch(const kernels::FindWidePlanes&, Counts*, cudaStream_t);
template void launch(const kernels::ChooseWidePlanes&, Counts*, cudaStream_t);
template void launch(const kernels::FindMirrored&, Counts*, cudaStream_t);
template void launch(const kernels::ConfirmMirrors&, Counts*, cudaStream_t);
template void launch(const kernels::CountMirrored&, Counts*, cudaStream_t);
template void launch(const kernels::ChooseMirrors&, Counts*, cudaStream_t);
template void launch(const kernels::OwnershipRound&, Counts*, cudaStream_t);
template void launch(const kernels::FindEvidence<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::PriorCellStep<DeviceMachine, kernels::PriorStep::kSupports>&, Counts*,
                     cudaStream_t);
template void launch(const kernels::PriorCellStep<DeviceMachine, kernels::PriorStep::kSurroundings>&, Counts*,
                     cudaStream_t);
template void launch(const kernels::PriorCellStep<DeviceMachine, kernels::PriorStep::kCandidates>&, Counts*,
                     cudaStream_t);
template void launch(const kernels::PriorCellStep<DeviceMachine, kernels::PriorStep::kPlanes>&, Counts*, cudaStream_t);
template void launch(const kernels::PriorCellStep<DeviceMachine, kernels::PriorStep::kChoice>&, Counts*, cudaStream_t);
template void launch(const kernels::PixelPriors<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::ReorderPlanes<DeviceMachine>&, Counts*, cudaStream_t);
template void launch(const kernels::WarpPixels<DeviceMachine, DeviceKeys>&, Counts*, cudaStream_t);
template void launch(const kernels::DepthImage<DeviceMachine>&, Counts*, cudaStream_t);

void splat_landmarks(const kernels::SplatLandmarks<DeviceKeys>& splat, int count, cudaStream_t stream) {
  constexpr int kPointThreads = 64;
  if (count == 0) return;
  splat_kernel<<<static_cast<unsigned>(count), kPointThreads, 0, stream>>>(splat);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
