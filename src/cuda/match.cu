// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"
#include "cuda/shared_patch.h"
#include "median.h"
#include "plane.h"

// PatchMatch and the median filter: the kernels of kernels/ with float, one pixel a thread. Pixels of a colour are
// neighbours in memory, so that a warp's accesses are contiguous.
namespace pmsp::cuda {
namespace {

using Visit = kernels::Visit<float, SharedPatch>;
using Matching = kernels::Matching<TextureCube>;

// Small blocks: a pass over the pixels of one colour of a small depth map is hardly more than one wave of blocks.
constexpr int kBlockWidth = 32;
constexpr int kBlockHeight = kPatchThreads / kBlockWidth;
constexpr int kMinBlocks = 14;  ///< a multiprocessor: 896 threads with 72 registers each

__device__ std::size_t index_of(const cpu::GridTables& grid, int y, int colour, int k) {
  const std::size_t half = static_cast<std::size_t>(grid.width / 2);
  return (static_cast<std::size_t>(y) * 2 + static_cast<std::size_t>(colour)) * half + static_cast<std::size_t>(k);
}

/// A thread's pixel.
struct Place {
  int k, x, y;
  std::size_t at;       ///< in checkerboard order
  std::size_t in_rows;  ///< in row order
  bool inside;
};

__device__ Place place_of(const cpu::GridTables& grid, int colour) {
  Place place;
  place.k = static_cast<int>(blockIdx.x * kBlockWidth + threadIdx.x);
  place.y = static_cast<int>(blockIdx.y * kBlockHeight + threadIdx.y);
  place.x = 2 * place.k + ((place.y + colour) & 1);
  place.inside = place.k < grid.width / 2 && place.y < grid.height;
  place.at = index_of(grid, place.y, colour, place.k);
  place.in_rows =
      static_cast<std::size_t>(place.y) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(place.x);
  return place;
}

__device__ Vec3<float> prior_plane(const MatchArgs& args, const Place& place) {
  return args.priors == nullptr ? Vec3<float>{0.0F, 0.0F, 0.0F} : plane_of(args.priors[place.in_rows]);
}

__device__ void begin(Visit& visit, const MatchArgs& args, const Place& place) {
  const cpu::GridTables& grid = args.grid;
  kernels::begin_visit(visit, args.matching, grid.sin_lon[2][place.x], grid.cos_lon[2][place.x], grid.sin_lat[place.y],
                       grid.cos_lat[place.y]);
  visit.prior = kernels::dot(prior_plane(args, place), visit.frame.bearing);
}

__device__ void keep(float4* state, std::size_t at, const kernels::Hypothesis<float>& best) {
  state[at] = make_float4(best.plane.x, best.plane.y, best.plane.z, best.score);
}

/// The plane of the nearest landmark, of the previous map's nearest surface, or none.
__device__ Vec3<float> candidate(const MatchArgs& args, std::size_t in_rows, int kind) {
  const std::uint64_t* keys = kind == 0 ? args.sparse_keys : args.warp_keys;
  const std::uint64_t key = keys == nullptr ? ~std::uint64_t{0} : keys[in_rows];
  if (key == ~std::uint64_t{0}) return {0.0F, 0.0F, 0.0F};
  const std::uint32_t index = static_cast<std::uint32_t>(key);
  if (kind == 0) {
    const SparsePoint& point = args.sparse_points[index];
    return {point.plane_x, point.plane_y, point.plane_z};
  }
  return kernels::moved_plane(plane_of(args.previous[index]), args.previous_from_reference);
}

__global__ void __launch_bounds__(kPatchThreads, kMinBlocks) start_kernel(const __grid_constant__ MatchArgs args) {
  __shared__ __half2 samples[kernels::kPatchSamples * kPatchThreads];
  const Place place = place_of(args.grid, static_cast<int>(blockIdx.z));
  if (!place.inside) return;
  kernels::Hypothesis<float> best{{0.0F, 0.0F, 0.0F}, -1.0F};
  if (args.color[place.in_rows].w != 0) {
    const Matching& matching = args.matching;
    Visit visit{{}, SharedPatch(samples)};
    begin(visit, args, place);
    const Vec3<float> first =
        kernels::random_start<float>(static_cast<std::uint32_t>(place.in_rows), visit.frame.bearing, matching);
#pragma unroll 1
    for (int kind = -1; kind < 2; ++kind) {
      kernels::propose(best, kind == -1 ? first : candidate(args, place.in_rows, kind), visit, matching);
    }
  }
  keep(args.state, place.at, best);
}

__global__ void __launch_bounds__(kPatchThreads, kMinBlocks)
    iterate_kernel(const __grid_constant__ MatchArgs args, int colour, int iteration, bool rescore) {
  __shared__ __half2 samples[kernels::kPatchSamples * kPatchThreads];
  const Place place = place_of(args.grid, colour);
  if (!place.inside || args.color[place.in_rows].w == 0) return;
  const Matching& matching = args.matching;
  const int half = args.grid.width / 2;
  Visit visit{{}, SharedPatch(samples)};
  begin(visit, args, place);
  const float4 before = args.state[place.at];
  kernels::Hypothesis<float> best{plane_of(before), before.w};
  if (rescore) best = {{0.0F, 0.0F, 0.0F}, -1.0F};
#pragma unroll 1
  for (int i = rescore ? -2 : 0; i < kernels::kNeighbours + matching.refinements; ++i) {
    Vec3<float> plane;
    if (i < 0) {
      plane = i == -2 ? plane_of(before) : prior_plane(args, place);
    } else if (i < kernels::kNeighbours) {
      const kernels::NeighbourOffset offset = kernels::neighbour_offset(i);
      const kernels::NeighbourRing from =
          kernels::neighbour_ring(args.grid.width, args.grid.height, place.y, colour, offset.dx, offset.dy);
      const int other = (place.k + from.shift + 2 * half) % half;
      plane = plane_of(args.state[index_of(args.grid, from.y, 1 - colour, other)]);
    } else {
      plane = kernels::refined(best, static_cast<std::uint32_t>(place.in_rows), iteration, i - kernels::kNeighbours,
                               visit.frame.bearing, matching);
    }
    kernels::propose(best, plane, visit, matching);
  }
  keep(args.state, place.at, best);
}

__device__ float depth_of(const float4& plane, const Vec3<float>& bearing) {
  const float inverse_depth = kernels::dot(plane_of(plane), bearing);
  return inverse_depth > 0.0F ? 1.0F / inverse_depth : 0.0F;
}

__device__ float confidence_of(float score) { return fminf(fmaxf(score, 0.0F), 1.0F); }

__global__ void to_rows_kernel(cpu::GridTables grid, const float4* state, float4* raw) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= grid.width || y >= grid.height) return;
  raw[row_index(grid, x, y)] = state[checkerboard_index(grid, x, y)];
}

__global__ void from_rows_kernel(cpu::GridTables grid, const float4* raw, float4* state) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= grid.width || y >= grid.height) return;
  state[checkerboard_index(grid, x, y)] = raw[row_index(grid, x, y)];
}

__global__ void export_kernel(cpu::GridTables grid, const float4* planes, MapArrays out) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= grid.width || y >= grid.height) return;
  const std::size_t at = row_index(grid, x, y);
  const float4 plane = planes[at];
  write_map(out, at, depth_of(plane, bearing_at(grid, x, y)), plane_of(plane), confidence_of(plane.w));
}

__global__ void median_kernel(const __grid_constant__ MedianArgs args) {
  const cpu::GridTables& grid = args.grid;
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  const bool inside = x < grid.width && y < grid.height;
  bool usable = false;
  float depth = 0.0F;
  float kept = 0.0F;
  if (inside) {
    const std::size_t at = row_index(grid, x, y);
    const float4 plane = args.raw[at];
    depth = depth_of(plane, bearing_at(grid, x, y));
    kept = depth;
    if (args.enabled) {
      float around[9];
      for (int dy = -1; dy <= 1; ++dy) {
        const bool beyond = y + dy < 0 || y + dy >= grid.height;  // over a pole, on the opposite meridian
        const int row = beyond ? y : y + dy;
        const int shift = (beyond ? grid.width / 2 : 0) + grid.width;
        for (int dx = -1; dx <= 1; ++dx) {
          const int column = (x + dx + shift) % grid.width;
          around[3 * dy + dx + 4] = depth_of(args.raw[row_index(grid, column, row)], bearing_at(grid, column, row));
        }
      }
      kept = kernels::median_filtered(around, confidence_of(plane.w), args.max_relative_deviation, args.min_score);
    }
    args.planes[at] = kept > 0.0F ? make_float4(plane.x, plane.y, plane.z, confidence_of(plane.w))
                                  : make_float4(0.0F, 0.0F, 0.0F, 0.0F);
    usable = args.color[at].w != 0;
  }
  if (args.counts == nullptr) return;
  count_if(usable, &args.counts->pixels);
  count_if(depth > 0.0F, &args.counts->matched);
  count_if(kept > 0.0F, &args.counts->after_median);
}

dim3 colour_grid(const cpu::GridTables& grid, int colours) {
  return dim3(static_cast<unsigned>(blocks(grid.width / 2, kBlockWidth)),
              static_cast<unsigned>(blocks(grid.height, kBlockHeight)), static_cast<unsigned>(colours));
}

}  // namespace

bool runs_here() {
  cudaFuncAttributes attributes{};
  const cudaError_t result = cudaFuncGetAttributes(&attributes, iterate_kernel);
  cudaGetLastError();  // clears it
  return result == cudaSuccess;
}

void start_pixels(const MatchArgs& args, cudaStream_t stream) {
  start_kernel<<<colour_grid(args.grid, 2), dim3(kBlockWidth, kBlockHeight), 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

void iterate_pixels(const MatchArgs& args, int colour, int iteration, bool rescore, cudaStream_t stream) {
  iterate_kernel<<<colour_grid(args.grid, 1), dim3(kBlockWidth, kBlockHeight), 0, stream>>>(args, colour, iteration,
                                                                                            rescore);
  PMSP_CUDA_LAUNCHED();
}

void to_rows(const cpu::GridTables& grid, const float4* state, float4* raw, cudaStream_t stream) {
  to_rows_kernel<<<image_grid(grid.width, grid.height), kImageBlock, 0, stream>>>(grid, state, raw);
  PMSP_CUDA_LAUNCHED();
}

void from_rows(const cpu::GridTables& grid, const float4* raw, float4* state, cudaStream_t stream) {
  from_rows_kernel<<<image_grid(grid.width, grid.height), kImageBlock, 0, stream>>>(grid, raw, state);
  PMSP_CUDA_LAUNCHED();
}

void export_planes(const cpu::GridTables& grid, const float4* planes, const MapArrays& out, cudaStream_t stream) {
  export_kernel<<<image_grid(grid.width, grid.height), kImageBlock, 0, stream>>>(grid, planes, out);
  PMSP_CUDA_LAUNCHED();
}

void median_pixels(const MedianArgs& args, cudaStream_t stream) {
  median_kernel<<<image_grid(args.grid.width, args.grid.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
