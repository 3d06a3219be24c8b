// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/device_code.h"
#include "cuda/launch.h"
#include "plane_prior.h"

// Planes for surfaces without texture (src/priors does the same on the CPU).
namespace pmsp::cuda {
namespace {

__global__ void variance_kernel(const __grid_constant__ PriorArgs args) {
  const cpu::GridTables& grid = args.grid;
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= grid.width || y >= grid.height) return;
  const auto frame =
      kernels::patch_frame(grid.sin_lon[2][x], grid.cos_lon[2][x], grid.sin_lat[y], grid.cos_lat[y], args.spacing);
  args.variance[row_index(grid, x, y)] = kernels::ramp_free_variance(args.image, frame);
}

enum class Step { kSupport, kPlane, kChoice };

template <Step step>
__global__ void cell_kernel(const __grid_constant__ PriorArgs args) {
  const int column = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int row = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (column >= args.cells.columns || row >= args.cells.rows) return;
  if constexpr (step == Step::kSupport) kernels::find_support(args.cells, column, row);
  if constexpr (step == Step::kPlane) kernels::find_plane(args.cells, column, row);
  if constexpr (step == Step::kChoice) kernels::choose_plane(args.cells, column, row);
}

__global__ void prior_kernel(const __grid_constant__ PriorArgs args) {
  const cpu::GridTables& grid = args.grid;
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= grid.width || y >= grid.height) return;
  const Vec3<float> plane = kernels::prior_at(args.cells, x, y);
  args.priors[row_index(grid, x, y)] = make_float4(plane.x, plane.y, plane.z, 0.0F);
}

}  // namespace

void find_priors(const PriorArgs& args, cudaStream_t stream) {
  const dim3 pixels = image_grid(args.grid.width, args.grid.height);
  const dim3 cells = image_grid(args.cells.columns, args.cells.rows);
  variance_kernel<<<pixels, kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
  cell_kernel<Step::kSupport><<<cells, kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
  cell_kernel<Step::kPlane><<<cells, kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
  cell_kernel<Step::kChoice><<<cells, kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
  prior_kernel<<<pixels, kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
