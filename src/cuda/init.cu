// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"
#include "plane.h"

// Where PatchMatch starts from (src/init does the same on the CPU). Where several candidates meet in a pixel, the
// smallest key wins: distance first, then the index, whatever the order of the threads.
namespace pmsp::cuda {
namespace {

constexpr int kPointThreads = 64;

__device__ void offer(std::uint64_t* keys, std::size_t at, float distance, std::uint32_t index) {
  const std::uint64_t key = static_cast<std::uint64_t>(__float_as_uint(distance)) << 32U | index;
  atomicMin(reinterpret_cast<unsigned long long*>(keys) + at, static_cast<unsigned long long>(key));
}

/// A block a landmark; the threads share its rows' pixels.
__global__ void splat_kernel(SplatArgs args) {
  const SparsePoint point = args.points[blockIdx.x];
  const float radius = args.radius;
  const int y0 = max(0, static_cast<int>(floorf(point.y - radius)));
  const int y1 = min(args.height - 1, static_cast<int>(floorf(point.y + radius)));
  for (int y = y0; y <= y1; ++y) {
    const float dy = static_cast<float>(y) + 0.5F - point.y;
    const float narrowing =
        fmaxf(cospif(0.5F - (static_cast<float>(y) + 0.5F) / static_cast<float>(args.height)), 1e-3F);
    const float reach = fminf(radius / narrowing, 0.5F * static_cast<float>(args.width) - 1.0F);
    const int first = static_cast<int>(floorf(point.x - reach));
    const int last = static_cast<int>(floorf(point.x + reach));
    for (int column = first + static_cast<int>(threadIdx.x); column <= last; column += kPointThreads) {
      const float dx = (static_cast<float>(column) + 0.5F - point.x) * narrowing;
      const float distance = dx * dx + dy * dy;
      if (distance > radius * radius) continue;
      const int x = (column + args.width) % args.width;
      offer(args.keys, static_cast<std::size_t>(y) * static_cast<std::size_t>(args.width) + static_cast<std::size_t>(x),
            distance, blockIdx.x);
    }
  }
}

__global__ void warp_kernel(const __grid_constant__ WarpArgs args) {
  const cpu::GridTables& grid = args.grid;
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= grid.width || y >= grid.height) return;
  const std::uint32_t from = static_cast<std::uint32_t>(y * grid.width + x);
  const Vec3<float> bearing = bearing_at(grid, x, y);
  const float inverse_depth = kernels::dot(plane_of(args.planes[from]), bearing);
  if (!(inverse_depth > 0.0F)) return;
  const Vec3<float> p = kernels::transform(args.reference_from_previous, (1.0F / inverse_depth) * bearing);
  const int to = kernels::pixel_index(p, args.width, args.height);
  offer(args.keys, static_cast<std::size_t>(to), sqrtf(kernels::dot(p, p)), from);
}

}  // namespace

void splat_points(const SplatArgs& args, cudaStream_t stream) {
  if (args.count == 0) return;
  splat_kernel<<<static_cast<unsigned>(args.count), kPointThreads, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

void warp_planes(const WarpArgs& args, cudaStream_t stream) {
  warp_kernel<<<image_grid(args.grid.width, args.grid.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
