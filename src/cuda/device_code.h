// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_fp16.h>

#include "agreement.h"
#include "cuda/device_types.h"
#include "cuda/memory.h"

// What the device's source files share.
namespace pmsp::cuda {

using kernels::Vec3;

inline int blocks(int count, int block) { return (count + block - 1) / block; }

/// Launch shape of kernels with a thread for each pixel of an image, or of `depth` images.
const dim3 kImageBlock(32, 8);
inline dim3 image_grid(int width, int height, int depth = 1) {
  return dim3(static_cast<unsigned>(blocks(width, static_cast<int>(kImageBlock.x))),
              static_cast<unsigned>(blocks(height, static_cast<int>(kImageBlock.y))), static_cast<unsigned>(depth));
}

/// After a launch: throws if it was refused.
#define PMSP_CUDA_LAUNCHED() PMSP_CUDA_CHECK(cudaGetLastError())

PMSP_HD bool is_empty(const TextureCube& cube) { return cube.texture == 0; }

PMSP_HD bool is_empty(const DevicePlanes& map) { return map.planes == nullptr; }

/// Gray value (0 to 255) in the direction p, by the texture units.
PMSP_HD float sample(const TextureCube& cube, const Vec3<float>& p) {
#if defined(__CUDA_ARCH__)
  return 255.0F * texCubemap<float>(cube.texture, p.x, p.y, p.z);
#else
  (void)cube;
  return p.x;  // never called: there is no texture unit
#endif
}

template <class F>
PMSP_HD Vec3<F> plane_at(const DevicePlanes& map, int index) {
  const float4 plane = map.planes[index];
  return {plane.x, plane.y, plane.z};
}

template <class F>
PMSP_HD Vec3<F> plane_at(const FilteredPlanes& map, int index) {
  if (!(map.confidence[index] > 0.0F)) return {0.0F, 0.0F, 0.0F};
  const float4 plane = map.planes[index];
  return {plane.x, plane.y, plane.z};
}

PMSP_HD float score_at(const DevicePlanes& map, int index) { return map.planes[index].w; }

PMSP_HD Vec3<float> plane_of(const float4& plane) { return {plane.x, plane.y, plane.z}; }

__device__ inline Vec3<float> bearing_at(const cpu::GridTables& grid, int x, int y) {
  return kernels::bearing(grid.sin_lon[2][x], grid.cos_lon[2][x], grid.sin_lat[y], grid.cos_lat[y]);
}

/// Index of pixel (x, y) in checkerboard order (SphereGrid).
__device__ inline std::size_t checkerboard_index(const cpu::GridTables& grid, int x, int y) {
  const std::size_t half = static_cast<std::size_t>(grid.width / 2);
  return (static_cast<std::size_t>(y) * 2 + static_cast<std::size_t>((x + y) & 1)) * half +
         static_cast<std::size_t>(x / 2);
}

/// Index of pixel (x, y) in row order.
__device__ inline std::size_t row_index(const cpu::GridTables& grid, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(x);
}

/// Adds the number of a block's threads for which `holds` is true; all threads of the warp call it.
__device__ inline void count_if(bool holds, unsigned int* counter) {
  const unsigned int mask = __ballot_sync(0xffffffffU, holds);
  const unsigned int thread = threadIdx.x + blockDim.x * threadIdx.y;
  if ((thread & 31U) == 0 && mask != 0) atomicAdd(counter, __popc(mask));
}

/// Writes a pixel of a depth map as the host wants it.
__device__ inline void write_map(const MapArrays& out, std::size_t at, float depth, const Vec3<float>& plane,
                                 float confidence) {
  if (out.depth == nullptr) return;
  const bool known = depth > 0.0F;
  const Vec3<float> normal = known ? -1.0F * kernels::normalized(plane) : Vec3<float>{0.0F, 0.0F, 0.0F};
  out.depth[at] = known ? depth : 0.0F;
  out.normal[3 * at] = normal.x;
  out.normal[3 * at + 1] = normal.y;
  out.normal[3 * at + 2] = normal.z;
  out.confidence[at] = known ? confidence : 0.0F;
}

}  // namespace pmsp::cuda
