// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cube.h"
#include "equirect.h"
#include "pmsp/types.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Owns the six faces that a kernels::CubeView reads (layout there).
struct CubeMap {
  int size = 0;
  std::vector<std::uint64_t> quads;

  kernels::CubeView view() const;
};

/// A cube map in a quarter of the memory: the nodes that its quads are made of, [face][size + 2][size + 2].
std::size_t node_count(int size);
void write_nodes(const CubeMap& cube, std::uint16_t* to);
CubeMap cube_of_nodes(const std::uint16_t* nodes, int size, ThreadPool& pool);

/// Faces as fine at their centres as an equirectangular image of this width is at the equator.
int cube_size_for(int width);

/// Size at which an image is compared with others: its own width, at most `scale` times that of the depth map, and the
/// depth map's shape; even.
struct ImageSize {
  int width, height;
};
ImageSize compared_size(int image_width, int width, int height, double scale);

/// Where a cube map's nodes lie in equirectangular images of one size. Found once for all images of a flight: it takes
/// longer than to read them there.
struct CubeNodes {
  CubeNodes(int size, int width, int height, ThreadPool& pool);
  bool is_of(int its_size, int its_width, int its_height) const {
    return size == its_size && width == its_width && height == its_height;
  }

  int size, width, height;
  std::vector<kernels::Pixel<float>> at;  ///< as nodes lie; undefined at corners
};

/// Resamples a gray equirectangular image (values 0 to 255) by cubic convolution (Catmull-Rom; Keys 1981), rounded to
/// 16 bits.
CubeMap make_cube_map(const Image<float>& gray, const CubeNodes& nodes, ThreadPool& pool);
CubeMap make_cube_map(const Image<float>& gray, int size, ThreadPool& pool);

/// 255 where a patch may be matched, 0 where it would reach into the mask: where any pixel is 0 within
/// `radius_px`, counted in pixels at the equator.
CubeMap make_usable_cube(const Image<std::uint8_t>& usable, int size, double radius_px, ThreadPool& pool);

}  // namespace pmsp
