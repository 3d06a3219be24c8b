// SPDX-License-Identifier: BSD-2-Clause
#include "ownership.h"

#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>
#include <cub/device/device_select.cuh>

#include "cuda/device_code.h"
#include "cuda/launch.h"
#include "fused_point.h"

// Launches the stages of kernels/fused_point.h and kernels/ownership.h, a thread for each pixel.
namespace pmsp::cuda {
namespace {

/// Threads of kernels over a list.
constexpr int kThreads = 128;

PMSP_HD kernels::GridView view_of(const cpu::GridTables& grid) {
  return {grid.sin_lon[2], grid.cos_lon[2], grid.sin_lat, grid.cos_lat};
}

/// Column and row of a thread's pixel. False beyond the image.
__device__ bool pixel_of_thread(int width, int height, int& x, int& y) {
  x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  return x < width && y < height;
}

__global__ void surfel_kernel(const __grid_constant__ SurfelArgs args) {
  int x = 0;
  int y = 0;
  bool fused = false;
  if (pixel_of_thread(args.grid.width, args.grid.height, x, y)) {
    const kernels::FusePixels<FilteredPlanes> stage{args.first, view_of(args.grid), args.others, args.num_others,
                                                    args.limits};
    const kernels::FusedPixel<float> made = stage.at<float>(x, y);
    const std::size_t at = row_index(args.grid, x, y);
    args.to.surfels[at] = made.point.surfel;
    args.to.details[at] = made.point.detail;
    args.to.standings[at] = static_cast<std::uint8_t>(made.standing);
    args.to.agree[at] = made.agree;
    fused = made.standing != 0U;
  }
  count_if(fused, &args.counts->fused);
}

__global__ void sight_kernel(const __grid_constant__ SightArgs args) {
  const int width = args.grid.width / 2;
  int x = 0;
  int y = 0;
  if (!pixel_of_thread(width, args.grid.height / 2, x, y)) return;
  float nearest = 0.0F;
  float farthest = 0.0F;
  for (int i = 0; i < 4; ++i) {
    const int column = 2 * x + (i & 1);
    const int row = 2 * y + (i >> 1);
    const Vec3<float> plane = plane_at<float>(args.map, row * args.grid.width + column);
    const float inverse_depth = kernels::dot(plane, bearing_at(args.grid, column, row));
    if (!(inverse_depth > 0.0F)) continue;
    const float depth = 1.0F / inverse_depth;
    nearest = nearest > 0.0F ? fminf(nearest, depth) : depth;
    farthest = fmaxf(farthest, depth);
  }
  const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  args.nearest[at] = nearest;
  args.farthest[at] = farthest;
}

__global__ void judge_kernel(const __grid_constant__ JudgeArgs args) {
  int x = 0;
  int y = 0;
  bool eligible = false;
  if (pixel_of_thread(args.grid.width, args.grid.height, x, y)) {
    const kernels::Eligibility stage{args.surfels, args.details,     view_of(args.grid), args.grid.width,
                                     args.viewers, args.num_viewers, args.limits,        args.max_contradiction};
    const std::uint32_t standing = stage.at<float>(x, y);
    args.standings[row_index(args.grid, x, y)] = static_cast<std::uint8_t>(standing);
    eligible = standing != 0U;
  }
  count_if(eligible, &args.counts->eligible);
}

__global__ void own_kernel(const __grid_constant__ OwnershipArgs args) {
  int x = 0;
  int y = 0;
  if (!pixel_of_thread(args.grid.width, args.grid.height, x, y)) return;
  const std::size_t at = row_index(args.grid, x, y);
  const std::uint8_t before = args.map.standings[at];
  std::uint8_t after = before;
  if (kernels::standing_of(before) == kernels::Standing::kOpen) {
    const kernels::OwnershipRound stage{args.map,        view_of(args.grid), args.others,
                                        args.num_others, args.first,         args.limits};
    after = kernels::with_standing(before, stage(x, y));
  }
  args.standings[at] = after;
}

struct MakesPoint {
  __host__ __device__ bool operator()(std::uint8_t standing) const { return kernels::makes_point(standing); }
};

void select(const std::uint8_t* standings, unsigned int* indices, unsigned int* count, int pixels, void* scratch,
            std::size_t& scratch_bytes, cudaStream_t stream) {
  PMSP_CUDA_CHECK(cub::DeviceSelect::Flagged(scratch, scratch_bytes, thrust::counting_iterator<unsigned int>(0),
                                             thrust::make_transform_iterator(standings, MakesPoint{}), indices, count,
                                             pixels, stream));
}

__global__ void owned_kernel(const __grid_constant__ OwnedArgs args) {
  const unsigned int count = *args.count;
  for (unsigned int i = blockIdx.x * blockDim.x + threadIdx.x; i < count; i += gridDim.x * blockDim.x) {
    const unsigned int at = args.indices[i];
    const kernels::PackedPoint<std::uint32_t> packed{args.map.surfels[at], args.map.details[at]};
    const std::uint32_t agree = args.map.agree[at];
    const int width = args.grid.width;
    const Vec3<float> bearing = bearing_at(args.grid, static_cast<int>(at) % width, static_cast<int>(at) / width);
    const Vec3<float> position = kernels::depth_of_surfel<float>(packed.surfel) * bearing;
    const Vec3<float> normal = kernels::normal_of(packed);
    DevicePoint point{};
    point.position[0] = position.x;
    point.position[1] = position.y;
    point.position[2] = position.z;
    point.normal[0] = normal.x;
    point.normal[1] = normal.y;
    point.normal[2] = normal.z;
    point.color[0] = static_cast<unsigned char>(packed.detail);
    point.color[1] = static_cast<unsigned char>(packed.detail >> 8U);
    point.color[2] = static_cast<unsigned char>(packed.detail >> 16U);
    point.views = static_cast<unsigned char>(1 + __popc(agree));
    point.confidence = kernels::confidence_of_level<float>(static_cast<std::uint32_t>(args.map.standings[at]) >> 2U);
    args.points[i] = point;
    args.agree[i] = agree;
  }
}

}  // namespace

void make_surfels(const SurfelArgs& args, cudaStream_t stream) {
  surfel_kernel<<<image_grid(args.grid.width, args.grid.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

void find_sight(const SightArgs& args, cudaStream_t stream) {
  sight_kernel<<<image_grid(args.grid.width / 2, args.grid.height / 2), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

void judge_pixels(const JudgeArgs& args, cudaStream_t stream) {
  judge_kernel<<<image_grid(args.grid.width, args.grid.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

void own_pixels(const OwnershipArgs& args, cudaStream_t stream) {
  own_kernel<<<image_grid(args.grid.width, args.grid.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

std::size_t owned_scratch_bytes(int pixels) {
  std::size_t bytes = 0;
  select(nullptr, nullptr, nullptr, pixels, nullptr, bytes, nullptr);
  return bytes;
}

void owned_points(const OwnedArgs& args, void* scratch, std::size_t scratch_bytes, cudaStream_t stream) {
  const int pixels = args.grid.width * args.grid.height;
  select(args.map.standings, args.indices, args.count, pixels, scratch, scratch_bytes, stream);
  owned_kernel<<<static_cast<unsigned>(std::min(blocks(pixels, kThreads), 8192)), kThreads, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
