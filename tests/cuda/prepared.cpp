// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/prepared.h"

#include "cuda/launch.h"
#include "cuda/on_device.h"
#include "cuda/transfers.h"
#include "sphere/cube_map.h"
#include "sphere/panorama_data.h"

namespace pmsp::test {
namespace {

std::unique_ptr<cuda::CubeTexture> filled(const cuda::DeviceArray<float>& gray, int width, int height) {
  const int size = cube_size_for(width);
  auto cube = std::make_unique<cuda::CubeTexture>(size, 16);
  cuda::fill_cube(gray.get(), width, height, {size, cube->surface()}, nullptr);
  PMSP_CUDA_CHECK(cudaDeviceSynchronize());
  return cube;
}

}  // namespace

PreparedOnDevice prepare_on_device(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width,
                                   int height) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::vector<unsigned char> bytes;
  std::vector<unsigned char> allowed;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const Rgb& color = image(x, y);
      bytes.insert(bytes.end(), {color.r, color.g, color.b});
      if (!mask.empty()) allowed.push_back(mask(x, y));
    }
  }
  const cuda::Stream stream;
  const cuda::DeviceSpanTable columns(image.width, width, stream);
  const cuda::DeviceSpanTable rows(image.height, height, stream);
  const auto image_on_device = uploaded(bytes);
  cuda::DeviceArray<unsigned char> mask_on_device;
  if (!mask.empty()) mask_on_device = uploaded(allowed);
  const cuda::DeviceArray<uchar4> color(pixels);
  const cuda::DeviceArray<float> gray(pixels);
  const cuda::DeviceArray<float> equalized(pixels);
  cuda::resize({image_on_device.get(), mask_on_device.get(), image.width, image.height, width, height, columns.view(),
                rows.view(), color.get(), gray.get()},
               nullptr);
  cuda::equalize_rows(gray.get(), equalized.get(), width, height, nullptr);
  PreparedOnDevice result;
  result.color = downloaded(color);
  result.gray = downloaded(equalized);
  result.cube = filled(equalized, width, height);
  if (!mask.empty()) {
    const int size = cube_size_for(width);
    const cuda::DeviceArray<unsigned char> scratch(pixels);
    result.usable = std::make_unique<cuda::CubeTexture>(size, 8);
    cuda::fill_matchable_cube(color.get(), width, height, kPatchReachPx, scratch.get(),
                              {size, result.usable->surface()}, nullptr);
    PMSP_CUDA_CHECK(cudaDeviceSynchronize());
  }
  return result;
}

std::unique_ptr<cuda::CubeTexture> cube_texture(const std::vector<float>& gray, int width, int height) {
  return filled(uploaded(gray), width, height);
}

}  // namespace pmsp::test
