// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"

// The consistency filter (src/filters does the same on the CPU).
namespace pmsp::cuda {
namespace {

__global__ void filter_kernel(const __grid_constant__ ConsistencyArgs args) {
  const cpu::GridTables& grid = args.grid;
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  bool kept = false;
  if (x < grid.width && y < grid.height) {
    const std::size_t at =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(x);
    const float4 plane = args.planes[at];
    const Vec3<float> bearing = bearing_at(grid, x, y);
    const float inverse_depth = kernels::dot(plane_of(plane), bearing);
    const float depth = inverse_depth > 0.0F ? 1.0F / inverse_depth : 0.0F;
    float confidence = plane.w;
    kept = depth > 0.0F;
    if (kept && args.enabled && args.num_others > 0) {
      kernels::Votes votes;
      for (int i = 0; i < args.num_others; ++i) {
        const DevicePlanes other{args.others[i].planes, grid.width, grid.height};
        votes.add(kernels::agreement(bearing, depth, other, args.others[i].other_from_first).closeness, args.tolerance);
      }
      confidence *= static_cast<float>(votes.agree) / static_cast<float>(args.num_others);
      kept = votes.keep(args.wanted);
    }
    args.confidence[at] = kept ? confidence : 0.0F;
    write_map(args.out, at, kept ? depth : 0.0F, plane_of(plane), confidence);
  }
  count_if(kept, &args.counts->after_consistency);
}

}  // namespace

void filter_pixels(const ConsistencyArgs& args, cudaStream_t stream) {
  const dim3 grid(static_cast<unsigned>(blocks(args.grid.width, 32)),
                  static_cast<unsigned>(blocks(args.grid.height, 8)));
  filter_kernel<<<grid, dim3(32, 8), 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
