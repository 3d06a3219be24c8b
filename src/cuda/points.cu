// SPDX-License-Identifier: BSD-2-Clause
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <algorithm>
#include <cub/device/device_select.cuh>

#include "cuda/device_code.h"
#include "cuda/launch.h"

namespace pmsp::cuda {
namespace {

constexpr int kThreads = 128;

struct MakesPoint {
  __host__ __device__ bool operator()(std::uint8_t status) const { return kernels::makes_point(status); }
};

void select(const std::uint8_t* statuses, unsigned int* indices, unsigned int* count, int pixels, void* scratch,
            std::size_t& scratch_bytes, cudaStream_t stream) {
  PMSP_CUDA_CHECK(cub::DeviceSelect::Flagged(scratch, scratch_bytes, thrust::counting_iterator<unsigned int>(0),
                                             thrust::make_transform_iterator(statuses, MakesPoint{}), indices, count,
                                             pixels, stream));
}

__global__ void owned_kernel(const __grid_constant__ EmitArgs args) {
  const unsigned int count = *args.count;
  for (unsigned int i = blockIdx.x * blockDim.x + threadIdx.x; i < count; i += gridDim.x * blockDim.x) {
    const kernels::EmittedPoint owned = kernels::emitted_point(args.map, args.grid, static_cast<int>(args.indices[i]));
    args.points[i] = {{owned.position.x, owned.position.y, owned.position.z},
                      {owned.normal.x, owned.normal.y, owned.normal.z},
                      {owned.color[0], owned.color[1], owned.color[2]},
                      static_cast<unsigned char>(1 + __popc(owned.agree)),
                      owned.confidence};
    args.agree[i] = owned.agree;
  }
}

}  // namespace

std::size_t emit_scratch_bytes(int pixels) {
  std::size_t bytes = 0;
  select(nullptr, nullptr, nullptr, pixels, nullptr, bytes, nullptr);
  return bytes;
}

void extract_points(const EmitArgs& args, void* scratch, std::size_t scratch_bytes, cudaStream_t stream) {
  const int pixels = args.grid.width * args.grid.height;
  select(args.map.statuses, args.indices, args.count, pixels, scratch, scratch_bytes, stream);
  owned_kernel<<<static_cast<unsigned>(std::min(blocks(pixels, kThreads), 8192)), kThreads, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
