// SPDX-License-Identifier: BSD-2-Clause
#include "sphere/cube_map.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "resample.h"

namespace pmsp {
namespace {

using kernels::Pixel;
using kernels::Vec3;

Vec3<float> face_direction(int face, float a, float b) {
  const float lead = face % 2 == 0 ? 1.0F : -1.0F;
  if (face < 2) return {lead, a, b};
  if (face < 4) return {a, lead, b};
  return {a, b, lead};
}

float node_coordinate(int k, int size) { return static_cast<float>(2 * k - 1) / static_cast<float>(size) - 1.0F; }

/// Direction of a node that is no corner. Nodes outside the face are the nearest texels of adjacent faces.
Vec3<float> node_direction(int face, int i, int j, int size) {
  const Vec3<float> direction = face_direction(face, node_coordinate(i, size), node_coordinate(j, size));
  if (i >= 1 && i <= size && j >= 1 && j <= size) return direction;
  kernels::CubeView cube{};
  cube.half_size = 0.5F * static_cast<float>(size);
  cube.face_elements = 1;  // so that the address is the number of the face
  const kernels::CubePoint<float> at = kernels::cube_point(direction, cube);
  const auto snapped = [&](float u) { return std::clamp(static_cast<int>(std::lround(u)), 1, size); };
  return face_direction(at.face_start, node_coordinate(snapped(at.u), size), node_coordinate(snapped(at.v), size));
}

/// Fills a cube from a function of image points.
template <class Function>
CubeMap fill_cube(const CubeNodes& nodes, ThreadPool& pool, const Function& value_of) {
  const int side = nodes.size + 2;
  std::vector<std::uint16_t> values(node_count(nodes.size));
  pool.for_each(6 * side, [&](int line) {
    const int j = line % side;
    const int inner_j = std::clamp(j, 1, nodes.size);
    const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(line) * side;
    const kernels::Pixel<float>* const row = nodes.at.data() + first;
    const kernels::Pixel<float>* const inner_row = row + static_cast<std::ptrdiff_t>(inner_j - j) * side;
    for (int i = 0; i < side; ++i) {
      const int inner_i = std::clamp(i, 1, nodes.size);
      std::uint16_t& value = values[static_cast<std::size_t>(first + i)];
      if (i == inner_i || j == inner_j) {
        value = value_of(row[i]);
      } else {  // three texels meet at a corner
        const int sum = value_of(inner_row[inner_i]) + value_of(inner_row[i]) + value_of(row[inner_i]);
        value = static_cast<std::uint16_t>((sum + 1) / 3);
      }
    }
  });
  return cube_of_nodes(values.data(), nodes.size, pool);
}

/// 0 within `radius_px` (pixels at the equator) of a pixel that is 0, 255 elsewhere.
Image<std::uint8_t> eroded(const Image<std::uint8_t>& mask, double radius_px) {
  const int width = mask.width();
  const int height = mask.height();
  Image<std::uint8_t> result(width, height, 255);
  const int rows = static_cast<int>(std::ceil(radius_px));
  for (int y = 0; y < height; ++y) {
    for (int dy = -rows; dy <= rows; ++dy) {
      const int to = y + dy;
      if (to < 0 || to >= height) continue;
      const double narrowing = std::cos((0.5 - (to + 0.5) / height) * kernels::kPi);
      const double across = std::sqrt(std::max(radius_px * radius_px - dy * dy, 0.0)) / std::max(narrowing, 1e-6);
      const int reach = static_cast<int>(std::min(std::ceil(across), 0.5 * width));
      for (int x = 0; x < width; ++x) {
        if (mask(x, y) != 0) continue;
        for (int dx = -reach; dx <= reach; ++dx) result((x + dx + width) % width, to) = 0;
      }
    }
  }
  return result;
}

}  // namespace

kernels::CubeView CubeMap::view() const {
  return {quads.empty() ? nullptr : quads.data(), 0.5F * static_cast<float>(size), size + 1, (size + 1) * (size + 1)};
}

std::size_t node_count(int size) {
  const std::size_t side = static_cast<std::size_t>(size) + 2;
  return 6 * side * side;
}

void write_nodes(const CubeMap& cube, std::uint16_t* to) {
  const std::size_t side = static_cast<std::size_t>(cube.size) + 1;
  for (std::size_t face = 0; face < 6; ++face) {
    for (std::size_t j = 0; j <= side; ++j) {
      const bool last_row = j == side;
      const std::uint64_t* const row = &cube.quads[(face * side + (last_row ? j - 1 : j)) * side];
      const unsigned shift = last_row ? 32U : 0U;
      for (std::size_t i = 0; i < side; ++i) *to++ = static_cast<std::uint16_t>(row[i] >> shift);
      *to++ = static_cast<std::uint16_t>(row[side - 1] >> (shift + 16U));
    }
  }
}

CubeMap cube_of_nodes(const std::uint16_t* all, int size, ThreadPool& pool) {
  const int nodes = size + 2;
  CubeMap cube;
  cube.size = size;
  const int side = size + 1;
  cube.quads.resize(static_cast<std::size_t>(6 * side) * static_cast<std::size_t>(side));
  pool.for_each(6 * side, [&](int line) {
    const std::size_t first = static_cast<std::size_t>(line / side * nodes + line % side);
    const std::uint16_t* upper = all + first * static_cast<std::size_t>(nodes);
    const std::uint16_t* lower = upper + nodes;
    std::uint64_t* quads = &cube.quads[static_cast<std::size_t>(line) * static_cast<std::size_t>(side)];
    for (int i = 0; i < side; ++i) {
      quads[i] = static_cast<std::uint64_t>(upper[i]) | static_cast<std::uint64_t>(upper[i + 1]) << 16U |
                 static_cast<std::uint64_t>(lower[i]) << 32U | static_cast<std::uint64_t>(lower[i + 1]) << 48U;
    }
  });
  return cube;
}

ImageSize matching_size(int image_width, int width, int height, double scale) {
  const auto even = [](double size) { return 2 * std::max(1, static_cast<int>(std::lround(0.5 * size))); };
  const int matched = std::min(image_width, even(scale * width));
  if (matched == width) return {width, height};
  return {matched, even(static_cast<double>(matched) * height / width)};
}

int cube_size_for(int width) { return std::max(8, 2 * static_cast<int>(std::lround(width / (2.0 * kernels::kPi)))); }

CubeNodes::CubeNodes(int its_size, int its_width, int its_height, ThreadPool& pool)
    : size(its_size), width(its_width), height(its_height), at(node_count(its_size)) {
  const int side = size + 2;
  pool.for_each(6 * side, [&](int line) {
    kernels::Pixel<float>* const row = at.data() + static_cast<std::ptrdiff_t>(line) * side;
    const bool at_edge = line % side == 0 || line % side == side - 1;
    for (int i = at_edge ? 1 : 0; i < (at_edge ? side - 1 : side); ++i) {
      row[i] = kernels::project(node_direction(line / side, i, line % side, size), static_cast<float>(width),
                                static_cast<float>(height));
    }
  });
}

CubeMap make_cube_map(const Image<float>& gray, const CubeNodes& nodes, ThreadPool& pool) {
  const kernels::GrayView view{gray.pixels().data(), gray.width(), gray.height()};
  return fill_cube(nodes, pool, [&](const Pixel<float>& at) {
    const float level = static_cast<float>(kernels::kUnitsPerGray) * kernels::sample_cubic(view, at);
    return static_cast<std::uint16_t>(std::clamp(level + 0.5F, 0.0F, 65535.0F));
  });
}

CubeMap make_cube_map(const Image<float>& gray, int size, ThreadPool& pool) {
  return make_cube_map(gray, CubeNodes(size, gray.width(), gray.height(), pool), pool);
}

CubeMap make_matchable_cube(const Image<std::uint8_t>& mask, int size, double radius_px, ThreadPool& pool) {
  const Image<std::uint8_t> inside = eroded(mask, radius_px);
  const CubeNodes nodes(size, mask.width(), mask.height(), pool);
  return fill_cube(nodes, pool, [&](const Pixel<float>& at) {
    const bool matchable = inside(kernels::column(at.x, mask.width()), kernels::row(at.y, mask.height())) != 0;
    return static_cast<std::uint16_t>(matchable ? 65535 : 0);
  });
}

}  // namespace pmsp
