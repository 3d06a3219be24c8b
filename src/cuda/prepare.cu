// SPDX-License-Identifier: BSD-2-Clause
#include "cube.h"
#include "cuda/device_code.h"
#include "cuda/launch.h"
#include "resample.h"

// Conversion of camera images to colours and cube maps.
namespace pmsp::cuda {
namespace {

__device__ unsigned char to_byte(float value) { return static_cast<unsigned char>(fminf(value + 0.5F, 255.0F)); }

/// Whether all source pixels covered by a target pixel are unmasked.
__device__ bool is_usable(const ResizeArgs& args, int x, int y) {
  const int y0 = static_cast<int>(static_cast<long long>(y) * args.source_height / args.height);
  const int y1 = static_cast<int>((static_cast<long long>(y + 1) * args.source_height + args.height - 1) / args.height);
  const int x0 = static_cast<int>(static_cast<long long>(x) * args.source_width / args.width);
  const int x1 = static_cast<int>((static_cast<long long>(x + 1) * args.source_width + args.width - 1) / args.width);
  for (int row = y0; row < y1; ++row) {
    for (int column = x0; column < x1; ++column) {
      if (args.mask[static_cast<std::size_t>(row) * static_cast<std::size_t>(args.source_width) +
                    static_cast<std::size_t>(column)] == 0) {
        return false;
      }
    }
  }
  return true;
}

__global__ void resize_kernel(const __grid_constant__ ResizeArgs args) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= args.width || y >= args.height) return;
  float red = 0.0F;
  float green = 0.0F;
  float blue = 0.0F;
  for (int j = 0; j < args.rows.count; ++j) {
    const float row_weight = args.rows.weights[y * args.rows.count + j];
    const int row = min(max(args.rows.first[y] + j, 0), args.source_height - 1);
    const unsigned char* line =
        args.image + static_cast<std::size_t>(row) * static_cast<std::size_t>(args.source_width) * 3;
    for (int i = 0; i < args.columns.count; ++i) {
      const float weight = row_weight * args.columns.weights[x * args.columns.count + i];
      const int column = (args.columns.first[x] + i + args.source_width) % args.source_width;
      red += weight * static_cast<float>(line[3 * column]);
      green += weight * static_cast<float>(line[3 * column + 1]);
      blue += weight * static_cast<float>(line[3 * column + 2]);
    }
  }
  const std::size_t at =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(args.width) + static_cast<std::size_t>(x);
  if (args.color != nullptr) {
    const bool usable = args.mask == nullptr || is_usable(args, x, y);
    args.color[at] = make_uchar4(to_byte(red), to_byte(green), to_byte(blue), usable ? 255 : 0);
  }
  if (args.gray != nullptr) args.gray[at] = 0.299F * red + 0.587F * green + 0.114F * blue;  // ITU-R BT.601
}

__global__ void equalize_kernel(const float* gray, float* equalized, int width, int height) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= width || y >= height) return;
  const float* row = gray + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  const float cos_lat = cospif(0.5F - (static_cast<float>(y) + 0.5F) / static_cast<float>(height));
  const float span = fminf(1.0F / cos_lat, 0.5F * static_cast<float>(width));
  const int reach = static_cast<int>((span - 1.0F) / 2.0F);                      // whole pixels to each side
  const float rest = ((span - 1.0F) / 2.0F - static_cast<float>(reach)) / span;  // weight of the partial ones
  float value = row[x];
  if (reach != 0 || rest >= 0.02F) {
    float sum = 0.0F;
    for (int i = -reach; i <= reach; ++i) sum += row[(x + i + width) % width];
    value = sum / span + rest * (row[(x - reach - 1 + width) % width] + row[(x + reach + 1) % width]);
  }
  equalized[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] = value;
}

__global__ void fill_cube_kernel(kernels::GrayView gray, CubeArgs cube) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int j = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  const int face = static_cast<int>(blockIdx.z);
  if (i >= cube.size || j >= cube.size) return;
  const float value = kernels::sample_cubic(gray, kernels::texture_direction(face, i, j, cube.size));
  constexpr float kScale = 65535.0F / 255.0F;
  const float level = fminf(fmaxf(kScale * value + 0.5F, 0.0F), 65535.0F);
  surfCubemapwrite(static_cast<unsigned short>(level), cube.surface, i * static_cast<int>(sizeof(unsigned short)), j,
                   face);
}

/// 0 within `radius` (pixels at the equator) of a masked pixel, 255 elsewhere.
__global__ void erode_kernel(const uchar4* color, unsigned char* eroded, int width, int height, float radius) {
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= width || y >= height) return;
  const int rows = static_cast<int>(ceilf(radius));
  bool usable = true;
  for (int dy = -rows; dy <= rows && usable; ++dy) {
    const int row = y + dy;
    if (row < 0 || row >= height) continue;
    const float narrowing = cospif(0.5F - (static_cast<float>(y) + 0.5F) / static_cast<float>(height));
    const float across = sqrtf(fmaxf(radius * radius - static_cast<float>(dy * dy), 0.0F)) / fmaxf(narrowing, 1e-6F);
    const int reach = static_cast<int>(fminf(ceilf(across), 0.5F * static_cast<float>(width)));
    const uchar4* line = color + static_cast<std::size_t>(row) * static_cast<std::size_t>(width);
    for (int dx = -reach; dx <= reach && usable; ++dx) usable = line[(x + dx + width) % width].w != 0;
  }
  eroded[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] =
      usable ? 255 : 0;
}

__global__ void fill_matchable_kernel(const unsigned char* eroded, int width, int height, CubeArgs cube) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int j = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  const int face = static_cast<int>(blockIdx.z);
  if (i >= cube.size || j >= cube.size) return;
  const int pixel = kernels::pixel_index(kernels::texture_direction(face, i, j, cube.size), width, height);
  surfCubemapwrite(eroded[pixel], cube.surface, i, j, face);
}

}  // namespace

void resize(const ResizeArgs& args, cudaStream_t stream) {
  resize_kernel<<<image_grid(args.width, args.height), kImageBlock, 0, stream>>>(args);
  PMSP_CUDA_LAUNCHED();
}

void equalize_rows(const float* gray, float* equalized, int width, int height, cudaStream_t stream) {
  equalize_kernel<<<image_grid(width, height), kImageBlock, 0, stream>>>(gray, equalized, width, height);
  PMSP_CUDA_LAUNCHED();
}

void fill_cube(const float* gray, int width, int height, const CubeArgs& cube, cudaStream_t stream) {
  fill_cube_kernel<<<image_grid(cube.size, cube.size, 6), kImageBlock, 0, stream>>>({gray, width, height}, cube);
  PMSP_CUDA_LAUNCHED();
}

void fill_matchable_cube(const uchar4* color, int width, int height, double radius_px, unsigned char* scratch,
                         const CubeArgs& cube, cudaStream_t stream) {
  erode_kernel<<<image_grid(width, height), kImageBlock, 0, stream>>>(color, scratch, width, height,
                                                                      static_cast<float>(radius_px));
  PMSP_CUDA_LAUNCHED();
  fill_matchable_kernel<<<image_grid(cube.size, cube.size, 6), kImageBlock, 0, stream>>>(scratch, width, height, cube);
  PMSP_CUDA_LAUNCHED();
}

}  // namespace pmsp::cuda
