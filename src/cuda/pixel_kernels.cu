// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/pixel_kernels.h"

#include "median.h"

// The kernels of kernels/ with float, one pixel a thread. What a row function of src/cpu/rows.h does for a batch of
// lanes, a thread does here for one pixel; pixels of a colour are neighbours in memory, so a warp's accesses are
// contiguous.
namespace pmsp::cuda {
namespace {

using kernels::Vec3;

__device__ int first_column(int y, int colour) { return (y + colour) & 1; }

__device__ std::size_t pixel_index(const cpu::GridTables& grid, int y, int colour, int k) {
  const std::size_t half = static_cast<std::size_t>(grid.width / 2);
  return (static_cast<std::size_t>(y) * 2 + static_cast<std::size_t>(colour)) * half + static_cast<std::size_t>(k);
}

__device__ void begin(kernels::Visit<float>& visit, const cpu::MatchJob& job, int y, int colour, int k) {
  const int parity = first_column(y, colour);
  kernels::begin_visit(visit, job.matching, job.grid.sin_lon[parity][k], job.grid.cos_lon[parity][k],
                       job.grid.sin_lat[y], job.grid.cos_lat[y]);
}

__device__ std::uint32_t pixel_number(const cpu::GridTables& grid, int y, int colour, int k) {
  return static_cast<std::uint32_t>(y * grid.width + first_column(y, colour) + 2 * k);
}

template <class Arrays>
__device__ Vec3<float> plane_at(const Arrays& planes, std::size_t at) {
  return {planes.x[at], planes.y[at], planes.z[at]};
}

__device__ void keep(const kernels::Hypothesis<float>& best, const cpu::MatchJob& job, std::size_t at) {
  job.planes.x[at] = best.plane.x;
  job.planes.y[at] = best.plane.y;
  job.planes.z[at] = best.plane.z;
  job.planes.score[at] = best.score;
}

}  // namespace

__global__ void start_pixels(cpu::MatchJob job) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  const int colour = static_cast<int>(blockIdx.z);
  if (k >= job.grid.width / 2 || y >= job.grid.height) return;
  const std::size_t at = pixel_index(job.grid, y, colour, k);
  kernels::Hypothesis<float> best{{0.0F, 0.0F, 0.0F}, -1.0F};
  if (job.usable == nullptr || job.usable[at] != 0.0F) {
    kernels::Visit<float> visit;
    begin(visit, job, y, colour, k);
    best = kernels::start<float>(pixel_number(job.grid, y, colour, k), visit, job.matching);
    for (int i = 0; i < job.num_candidates; ++i) {
      kernels::propose(best, plane_at(job.candidates[i], at), visit, job.matching);
    }
  }
  keep(best, job, at);
}

__global__ void iterate_pixels(cpu::MatchJob job, int colour, int iteration) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  const int half = job.grid.width / 2;
  if (k >= half || y >= job.grid.height) return;
  const std::size_t at = pixel_index(job.grid, y, colour, k);
  if (job.usable != nullptr && job.usable[at] == 0.0F) return;
  kernels::Visit<float> visit;
  begin(visit, job, y, colour, k);
  kernels::Hypothesis<float> best{plane_at(job.planes, at), job.planes.score[at]};
  for (int i = 0; i < kernels::kNeighbours; ++i) {
    const kernels::NeighbourOffset offset = kernels::neighbour_offset(i);
    const kernels::NeighbourRing from =
        kernels::neighbour_ring(job.grid.width, job.grid.height, y, colour, offset.dx, offset.dy);
    const int other = (k + from.shift + 2 * half) % half;
    kernels::propose(best, plane_at(job.planes, pixel_index(job.grid, from.y, 1 - colour, other)), visit, job.matching);
  }
  kernels::refine(best, pixel_number(job.grid, y, colour, k), iteration, visit, job.matching);
  keep(best, job, at);
}

__global__ void median_pixels(cpu::MedianJob job) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= job.width || y >= job.height) return;
  float around[9];
  for (int dy = -1; dy <= 1; ++dy) {
    const bool beyond = y + dy < 0 || y + dy >= job.height;  // over a pole, on the opposite meridian
    const int row = beyond ? y : y + dy;
    const int shift = (beyond ? job.width / 2 : 0) + job.width;
    for (int dx = -1; dx <= 1; ++dx)
      around[3 * dy + dx + 4] = job.depth[row * job.width + (x + dx + shift) % job.width];
  }
  const int at = y * job.width + x;
  job.filtered[at] = kernels::median_filtered(around, job.score[at], job.max_relative_deviation, job.min_score);
}

__global__ void compare_pixels(cpu::CompareJob job, cpu::CompareRow out) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= job.grid.width || y >= job.grid.height) return;
  const int at = y * job.grid.width + x;
  const float depth = job.depth[at];
  const Vec3<float> bearing =
      kernels::bearing(job.grid.sin_lon[2][x], job.grid.cos_lon[2][x], job.grid.sin_lat[y], job.grid.cos_lat[y]);
  const auto seen = kernels::agreement(bearing, depth > 0.0F ? depth : 1.0F, job.other, job.other_from_first);
  out.closeness[at] = depth > 0.0F ? seen.closeness : 0.0F;
  out.implied_depth[at] = seen.implied_depth;
  out.parallax_gain[at] = seen.parallax_gain;
  out.index[at] = seen.index;
}

}  // namespace pmsp::cuda
