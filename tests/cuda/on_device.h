// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "cuda/device_types.h"
#include "cuda/memory.h"
#include "match.h"

/// Functions of kernels/ called once for each index, on the host and on the device.
namespace pmsp::test {

/// `values` numbers for each index.
struct Both {
  int values = 1;
  std::vector<float> host;
  std::vector<float> device;
};

/// kernels/random.h: uniform, uniform_signed.
Both random_draws(int count);

/// kernels/plane.h: random_plane (3 values), perturbed (3), moved_plane (3), is_allowed.
Both planes(int count);

/// kernels/median.h: median9, median_filtered.
Both medians(int count);

/// kernels/agreement.h: depth_ratio, implied depth, index; against a map of wavy planes.
Both agreements(int count);

/// kernels/cube.h: a sample of `cube` in a random direction.
Both cube_samples(const kernels::CubeView& cube, std::size_t elements, int count);

/// A keyframe's matching, with the number of elements behind each of its images.
template <class Cube>
struct Scoring {
  kernels::MatchArgs<Cube> match_args;
  std::size_t elements = 0;
  int width = 0, height = 0;
  float depth = 0.0F;  ///< of the planes that are scored; they face the camera
};

/// kernels/patch.h: variance of the pixel's patch and plane_score, for each pixel.
Both patch_scores(const Scoring<kernels::CubeView>& scoring);

/// The same on the device alone, by the texture units.
std::vector<float> patch_scores(const Scoring<cuda::TextureCube>& scoring);

/// Samples of a texture [0 to 255] in directions of three numbers each.
std::vector<float> texture_samples(const cuda::TextureCube& cube, const std::vector<float>& directions);

/// Copies to the device and back.
template <class T>
cuda::DeviceArray<T> uploaded(const std::vector<T>& values) {
  cuda::DeviceArray<T> array(values.size());
  PMSP_CUDA_CHECK(cudaMemcpy(array.get(), values.data(), values.size() * sizeof(T), cudaMemcpyHostToDevice));
  return array;
}
template <class T>
std::vector<T> downloaded(const cuda::DeviceArray<T>& array) {
  std::vector<T> values(array.size());
  PMSP_CUDA_CHECK(cudaMemcpy(values.data(), array.get(), values.size() * sizeof(T), cudaMemcpyDeviceToHost));
  return values;
}

}  // namespace pmsp::test
