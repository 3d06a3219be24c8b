// SPDX-License-Identifier: BSD-2-Clause
#include "confidence.h"
#include "cuda/device_code.h"
#include "cuda/launch.h"

// The consistency filter (src/filters does the same on the CPU).
namespace pmsp::cuda {
namespace {

/// Mean deviation of the planes around a pixel.
__device__ float roughness(const ConsistencyArgs& args, int x, int y, const Vec3<float>& bearing, float depth) {
  const cpu::GridTables& grid = args.grid;
  float sum = 0.0F;
  for (int i = 0; i < kernels::kRoughnessOffsets; ++i) {
    int dx = 0;
    int dy = 0;
    kernels::roughness_offset(i, dx, dy);
    int row = y + dy;
    if (row < 0 || row >= grid.height) {  // beyond a pole, on the opposite meridian
      row = row < 0 ? -1 - row : 2 * grid.height - 1 - row;
      dx = grid.width / 2;
    }
    const int column = (x + dx + grid.width) % grid.width;
    sum += kernels::deviation(plane_of(args.planes[row_index(grid, column, row)]), bearing, depth);
  }
  return sum / static_cast<float>(kernels::kRoughnessOffsets);
}

__global__ void filter_kernel(const __grid_constant__ ConsistencyArgs args) {
  const cpu::GridTables& grid = args.grid;
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  bool kept = false;
  if (x < grid.width && y < grid.height) {
    const std::size_t at = row_index(grid, x, y);
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
        const auto seen = kernels::agreement(bearing, depth, other, args.others[i].other_from_first);
        votes.add(seen.closeness, seen.parallax_gain, args.tolerance);
      }
      kept = votes.keep(args.wanted);
      if (kept) {
        confidence = kernels::confidence_of_error(kernels::expected_error(votes, roughness(args, x, y, bearing, depth),
                                                                          args.num_others, plane.w, args.pixel_angle));
      }
    }
    args.confidence[at] = kept ? confidence : 0.0F;
    write_map(args.out, at, kept ? depth : 0.0F, plane_of(plane), confidence);
  }
  count_if(kept, &args.counts->after_consistency);
}

}  // namespace

void filter_pixels(const ConsistencyArgs& args, cudaStream_t stream) {
  filter_kernel<<<image_grid(args.grid.width, args.grid.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
