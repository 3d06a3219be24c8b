// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "vec3.h"

// A panorama as six square faces, so that a direction becomes a texture address by one division, without trigonometry.
// Faces are ordered +x, -x, +y, -y, +z, -z; on each, the two other coordinates (in the order x, y, z) divided by the
// magnitude of the leading one cover [-1, 1]. Texels are the centres of `size` x `size` cells, node k of `size` + 2 at
// -1 + (2 k - 1) / size; the outermost nodes are texels of adjacent faces, so that samples are continuous across edges.
// (GPUs filter cube maps the same way.)
namespace pmsp::kernels {

/// Gray values of a face map. `quads[face * face_elements + j * (size + 1) + i]` packs the 2 x 2 nodes from (i, j) as
/// four numbers of 16 bits, lowest first: (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1); one 64-bit read per bilinear
/// sample. Rounding to bytes would affect scores.
struct CubeView {
  const std::uint64_t* quads;
  float half_size;             ///< size / 2
  std::int32_t row_elements;   ///< size + 1
  std::int32_t face_elements;  ///< (size + 1)^2
};

/// Units of a 16-bit texel per gray level.
constexpr int kUnitsPerGray = 257;

PMSP_HD bool is_empty(const CubeView& cube) { return cube.quads == nullptr; }

/// Direction of the centre of texel (i, j) of a GPU's cube map: faces in the same order, some of them rotated and
/// mirrored (CUDA C++ Programming Guide, "Cubemap Textures"; OpenGL).
PMSP_HD Vec3<float> texture_direction(int face, int i, int j, int size) {
  const float a = (2.0F * static_cast<float>(i) + 1.0F) / static_cast<float>(size) - 1.0F;
  const float b = (2.0F * static_cast<float>(j) + 1.0F) / static_cast<float>(size) - 1.0F;
  switch (face) {
    case 0:
      return {1.0F, -b, -a};
    case 1:
      return {-1.0F, -b, a};
    case 2:
      return {a, 1.0F, b};
    case 3:
      return {a, -1.0F, -b};
    case 4:
      return {a, -b, 1.0F};
    default:
      return {-a, -b, -1.0F};
  }
}

/// Address on the cube: face coordinates in [0.5, size + 0.5], node k at k, and the index of the face's first element.
template <class F>
struct CubePoint {
  F u, v;
  IntOf<F> face_start;
};

template <class F>
PMSP_HD CubePoint<F> cube_point(const Vec3<F>& p, const CubeView& cube) {
  using I = IntOf<F>;
  const F ax = abs(p.x);
  const F ay = abs(p.y);
  const F az = abs(p.z);
  const F lead = max(ax, max(ay, az));
  const auto along_x = ax == lead;
  const auto along_y = ay == lead;  // where both hold, x wins below
  const F scale = F(cube.half_size) / lead;
  const F first = select(along_x, p.y, p.x);
  const F second = select(along_x, p.z, select(along_y, p.z, p.y));
  const F signed_lead = select(along_x, p.x, select(along_y, p.y, p.z));
  const F face = select(along_x, F(0), select(along_y, F(2), F(4))) + select(signed_lead < F(0), F(1), F(0));
  const F middle(cube.half_size + 0.5F);
  return {fma(first, scale, middle), fma(second, scale, middle), to_int(face) * I(cube.face_elements)};
}

/// Bilinear sample (0 to 255) in the direction p (any length > 0).
template <class F>
PMSP_HD F sample(const CubeView& cube, const Vec3<F>& p) {
  using I = IntOf<F>;
  using U = UIntOf<F>;
  const CubePoint<F> at = cube_point(p, cube);
  const F iu = whole(at.u);
  const F iv = whole(at.v);
  const I index = at.face_start + to_int(iv) * I(cube.row_elements) + to_int(iu);
  const auto quad = gather_halves<F>(cube.quads, index);
  const F t00 = from_uint<F>(U(quad.low & U(0xffffU)));
  const F t10 = from_uint<F>(U(quad.low >> 16));
  const F t01 = from_uint<F>(U(quad.high & U(0xffffU)));
  const F t11 = from_uint<F>(U(quad.high >> 16));
  const F fu = at.u - iu;
  const F upper = fma(fu, t10 - t00, t00);
  const F lower = fma(fu, t11 - t01, t01);
  return F(1.0F / kUnitsPerGray) * fma(at.v - iv, lower - upper, upper);
}

}  // namespace pmsp::kernels
