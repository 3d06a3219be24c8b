// SPDX-License-Identifier: BSD-2-Clause
#include <thrust/iterator/counting_iterator.h>
#include <cub/device/device_select.cuh>

#include "cuda/device_code.h"
#include "cuda/launch.h"
#include "fusion.h"

// Fusion (src/fusion does the same on the CPU), in three steps so that points come in row order whatever the order of
// the threads: which pixels make a point, their indices without gaps, the points.
namespace pmsp::cuda {
namespace {

__device__ Vec3<float> facing_normal(const Vec3<float>& plane) { return -1.0F * kernels::normalized(plane); }

__device__ Vec3<float> color_of(const uchar4& color) {
  return {static_cast<float>(color.x), static_cast<float>(color.y), static_cast<float>(color.z)};
}

/// Averages over the maps that agree on a pixel. False when a later map that sees the surface from much closer is to
/// make the point.
__device__ bool average(const FuseArgs& args, int x, int y, int at, kernels::FusionSums& sums) {
  const cpu::GridTables& grid = args.grid;
  const Vec3<float> plane = plane_of(args.planes[at]);
  const Vec3<float> bearing = bearing_at(grid, x, y);
  const float depth = 1.0F / kernels::dot(plane, bearing);
  const Vec3<float> normal = facing_normal(plane);
  sums.add(kernels::fusion_weight(args.confidence[at], depth), depth, normal, color_of(args.color[at]));
  for (int i = 0; i < args.num_others; ++i) {
    const FuseArgs::Other& other = args.others[i];
    const FilteredPlanes map{other.planes, other.confidence, grid.width, grid.height};
    const auto seen = kernels::agreement(bearing, depth, map, other.other_from_first);
    if (fabsf(seen.closeness - 1.0F) > args.max_relative_depth) continue;
    const int ox = seen.index % grid.width;
    const int oy = seen.index / grid.width;
    const Vec3<float> other_plane = plane_of(other.planes[seen.index]);
    const Vec3<float> turned = kernels::rotate_back(other.other_from_first, facing_normal(other_plane));
    if (kernels::dot(turned, normal) < args.min_cos) continue;
    const float other_depth = 1.0F / kernels::dot(other_plane, bearing_at(grid, ox, oy));
    if (other.later && other_depth < kernels::kMuchCloser * depth) return false;
    sums.add(kernels::fusion_weight(other.confidence[seen.index], other_depth), seen.implied_depth, turned,
             color_of(other.color[seen.index]));
  }
  return true;
}

__global__ void choose_kernel(const __grid_constant__ FuseArgs args) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= args.grid.width || y >= args.grid.height) return;
  const int at = y * args.grid.width + x;
  const float confidence = args.confidence[at];
  kernels::FusionSums sums;
  args.chosen[at] =
      confidence > 0.0F && confidence >= args.min_confidence && args.covered[at] == 0 && average(args, x, y, at, sums);
}

__device__ unsigned char to_byte(float value) {
  return static_cast<unsigned char>(fminf(fmaxf(value + 0.5F, 0.0F), 255.0F));
}

__global__ void point_kernel(const __grid_constant__ FuseArgs args) {
  const cpu::GridTables& grid = args.grid;
  const unsigned int count = *args.count;
  for (unsigned int i = blockIdx.x * blockDim.x + threadIdx.x; i < count; i += gridDim.x * blockDim.x) {
    const int at = static_cast<int>(args.indices[i]);
    const int x = at % grid.width;
    const int y = at / grid.width;
    kernels::FusionSums sums;
    average(args, x, y, at, sums);
    const Vec3<float> position = (sums.depth / sums.weight) * bearing_at(grid, x, y);
    const Vec3<float> normal = kernels::normalized((1.0F / sums.weight) * sums.normal);
    const Vec3<float> color = (1.0F / sums.weight) * sums.color;
    DevicePoint point{};
    point.position[0] = position.x;
    point.position[1] = position.y;
    point.position[2] = position.z;
    point.normal[0] = normal.x;
    point.normal[1] = normal.y;
    point.normal[2] = normal.z;
    point.color[0] = to_byte(color.x);
    point.color[1] = to_byte(color.y);
    point.color[2] = to_byte(color.z);
    point.views = static_cast<unsigned char>(sums.views);
    point.confidence = args.confidence[at];
    args.points[i] = point;
    for (int k = 0; k < args.num_others; ++k) {
      const FuseArgs::Other& other = args.others[k];
      if (!other.later) continue;
      const Vec3<float> p = kernels::transform(other.other_from_first, position);
      const float range = sqrtf(kernels::dot(p, p));
      kernels::for_each_covered(p, args.spacing, grid.cos_lat, grid.width, grid.height, [&](int pixel) {
        if (!(other.confidence[pixel] > 0.0F)) return;
        const Vec3<float> bearing = bearing_at(grid, pixel % grid.width, pixel / grid.width);
        const float depth = 1.0F / kernels::dot(plane_of(other.planes[pixel]), bearing);
        if (fabsf(depth - range) <= args.max_relative_depth * range) other.covered[pixel] = 1;
      });
    }
  }
}

}  // namespace

std::size_t fuse_scratch_bytes(int pixels) {
  std::size_t bytes = 0;
  PMSP_CUDA_CHECK(cub::DeviceSelect::Flagged(
      nullptr, bytes, thrust::counting_iterator<unsigned int>(0), static_cast<const unsigned char*>(nullptr),
      static_cast<unsigned int*>(nullptr), static_cast<unsigned int*>(nullptr), pixels));
  return bytes;
}

void fuse_pixels(const FuseArgs& args, void* scratch, std::size_t scratch_bytes, cudaStream_t stream) {
  choose_kernel<<<image_grid(args.grid.width, args.grid.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
  const int pixels = args.grid.width * args.grid.height;
  PMSP_CUDA_CHECK(cub::DeviceSelect::Flagged(scratch, scratch_bytes, thrust::counting_iterator<unsigned int>(0),
                                             args.chosen, args.indices, args.count, pixels, stream));
  constexpr int kThreads = 128;
  point_kernel<<<static_cast<unsigned>(std::min(blocks(pixels, kThreads), 8192)), kThreads, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
