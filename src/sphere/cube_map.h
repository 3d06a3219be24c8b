// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cube.h"
#include "equirect.h"
#include "pmsp/types.h"
#include "util/thread_pool.h"

namespace pmsp {

/// Owner of the six faces of a kernels::CubeView (layout there).
struct CubeMap {
  int size = 0;
  std::vector<std::uint64_t> quads;

  kernels::CubeView view() const;
};

/// Cube map in a quarter of the memory: the nodes of its quads, [face][size + 2][size + 2].
std::size_t node_count(int size);
void write_nodes(const CubeMap& cube, std::uint16_t* to);
CubeMap cube_of_nodes(const std::uint16_t* nodes, int size, ThreadPool& pool);

/// Size of faces with the resolution, at their centres, of an equirectangular image of this width at the equator.
int cube_size_for(int width);

/// Size at which an image is matched: its own width, at most `scale` times that of the depth map, and the depth map's
/// shape; even.
struct ImageSize {
  int width, height;
};
ImageSize matching_size(int image_width, int width, int height, double scale);

/// Image points of a cube map's nodes in equirectangular images of one size. Computed once for all images of a
/// sequence, since this takes longer than sampling.
struct CubeNodes {
  CubeNodes(int size, int width, int height, ThreadPool& pool);
  bool matches(int its_size, int its_width, int its_height) const {
    return size == its_size && width == its_width && height == its_height;
  }

  int size, width, height;
  std::vector<kernels::Pixel<float>> at;  ///< in the order of the nodes; undefined at corners
};

/// Resamples a gray equirectangular image (values 0 to 255) by cubic convolution (Catmull-Rom; Keys 1981), rounded to
/// 16 bits.
CubeMap make_cube_map(const Image<float>& gray, const CubeNodes& nodes, ThreadPool& pool);
CubeMap make_cube_map(const Image<float>& gray, int size, ThreadPool& pool);

/// 255 where a patch may be matched, 0 within `radius_px` (pixels at the equator) of a pixel that is 0.
CubeMap make_matchable_cube(const Image<std::uint8_t>& mask, int size, double radius_px, ThreadPool& pool);

}  // namespace pmsp
