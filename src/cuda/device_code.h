// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_fp16.h>

#include "agreement.h"
#include "cuda/device_types.h"
#include "cuda/memory.h"

// Shared by the device's source files.
namespace pmsp::cuda {

using kernels::Vec3;

inline int blocks(int count, int block) { return (count + block - 1) / block; }

/// Launch shape of kernels with one thread per pixel of an image, or of `depth` images.
const dim3 kImageBlock(32, 8);
inline dim3 image_grid(int width, int height, int depth = 1, dim3 block = kImageBlock) {
  return dim3(static_cast<unsigned>(blocks(width, static_cast<int>(block.x))),
              static_cast<unsigned>(blocks(height, static_cast<int>(block.y))), static_cast<unsigned>(depth));
}

/// After a launch: throws if it failed.
#define PMSP_CUDA_LAUNCHED() PMSP_CUDA_CHECK(cudaGetLastError())

PMSP_HD bool is_empty(const TextureCube& cube) { return cube.texture == 0; }

PMSP_HD bool is_empty(const DevicePlanes& map) { return map.planes == nullptr; }

/// Gray value (0 to 255) in the direction p, by the texture units.
PMSP_HD float sample(const TextureCube& cube, const Vec3<float>& p) {
#if defined(__CUDA_ARCH__)
  return 255.0F * texCubemap<float>(cube.texture, p.x, p.y, p.z);
#else
  (void)cube;
  return p.x;              // never called on the host
#endif
}

template <class F>
PMSP_HD Vec3<F> plane_at(const DevicePlanes& map, int index) {
  const float4 plane = map.planes[index];
  return {plane.x, plane.y, plane.z};
}
template <class F>
PMSP_HD F score_at(const DevicePlanes& map, int index) {
  return map.planes[index].w;
}

template <class F>
PMSP_HD void put(const DevicePlaneArray& to, std::size_t at, int /*count*/, const kernels::Hypothesis<F>& found) {
  to.planes[at] = make_float4(found.plane.x, found.plane.y, found.plane.z, found.score);
}
template <class F>
PMSP_HD kernels::Hypothesis<F> in_ring(const DevicePlaneArray& from, std::size_t first, int k, int count) {
  const float4 found = from.planes[first + static_cast<std::size_t>((k + 2 * count) % count)];
  return {{found.x, found.y, found.z}, found.w};
}

template <class F>
PMSP_HD bool is_unmasked(const ColorMask& mask, int index) {
  return mask.color[index].w != 0;
}

PMSP_HD void atomic_min_key(const DeviceKeys& keys, int pixel, std::uint64_t key) {
#if defined(__CUDA_ARCH__)
  atomicMin(reinterpret_cast<unsigned long long*>(keys.keys) + pixel, static_cast<unsigned long long>(key));
#else
  keys.keys[pixel] = key;  // never called on the host
#endif
}

/// Adds the number of a warp's threads for which `holds` is true; called by all of its threads.
__device__ inline void count_if(bool holds, unsigned int* counter) {
  const unsigned int mask = __ballot_sync(0xffffffffU, holds);
  const unsigned int thread = threadIdx.x + blockDim.x * threadIdx.y;
  if ((thread & 31U) == 0 && mask != 0) atomicAdd(counter, __popc(mask));
}

}  // namespace pmsp::cuda
