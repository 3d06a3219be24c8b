// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "agreement.h"
#include "cube.h"
#include "grid_view.h"

// A stage is a functor that computes one step of the pipeline for one pixel, or for as many consecutive pixels of a row
// as its number type has lanes. It holds plain views of its input and output, so that CPU rows and GPU threads run the
// same code:
//
//   static constexpr int kCounts;                  // number of counters
//   int width() const; int height() const;         // of the image
//   template <class F> void operator()(const RowPixels<F>& at, MaskOf<F>* counted) const;
//
// `ViewTypes` names the view types of a processor: Map (planes to read), Planes (planes to write), State (planes in
// checkerboard order), Cube (images), Mask (unmasked pixels), Landmarks and Warped (initial planes).
namespace pmsp::kernels {

/// Current pixel or pixels of a stage.
template <class F>
struct RowPixels {
  IntOf<F> column, index;  ///< of each lane, in row order; lanes beyond the last column repeat it
  int row;
  int first;  ///< index of the first lane
  int count;  ///< lanes up to the last column
};

/// A single pixel.
PMSP_HD RowPixels<float> single_pixel(int column, int row, int width) {
  const int index = row * width + column;
  return {column, index, row, index, 1};
}

template <class F>
PMSP_HD Vec3<F> bearing_at(const GridView& grid, const RowPixels<F>& at) {
  return bearing(gather<F>(grid.sin_lon, at.column), gather<F>(grid.cos_lon, at.column), F(grid.sin_lat[at.row]),
                 F(grid.cos_lat[at.row]));
}

/// Index of the pixel at offset (dx, dy), across seam and poles.
template <class F>
PMSP_HD IntOf<F> wrapped_index(const GridView& grid, const RowPixels<F>& at, int dx, int dy) {
  const WrappedPixel<F> there = wrapped_pixel<F>(grid, at.column, at.row, dx, dy);
  return there.row * IntOf<F>(grid.width) + there.column;
}

/// Factor for column offsets of up to `reach` pixels, so that they span the same angle in this row as at the equator;
/// limited to offsets of an eighth of the width.
PMSP_HD float column_stretch(const GridView& grid, int row, int reach) {
  constexpr float kWidest = 0.125F;
  return min(1.0F / grid.cos_lat[row], kWidest * static_cast<float>(grid.width) / static_cast<float>(reach));
}

/// Plane and score of a pixel.
template <class F>
struct Hypothesis {
  Vec3<F> plane;
  F score;
};

/// Writable planes and scores in host memory, one array per coordinate.
struct PlaneArrays {
  float* x;
  float* y;
  float* z;
  float* score;
};
template <class F>
PMSP_HD void put(const PlaneArrays& to, std::size_t first, int count, const Hypothesis<F>& found) {
  store<F>(found.plane.x, to.x + first, count);
  store<F>(found.plane.y, to.y + first, count);
  store<F>(found.plane.z, to.z + first, count);
  store<F>(found.score, to.score + first, count);
}

/// Hypotheses of a ring of `count` pixels that starts at `first`, from its element k (any number > -count).
template <class F>
PMSP_HD Hypothesis<F> in_ring(const PlaneArrays& from, std::size_t first, int k, int count) {
  return {{load_ring<F>(from.x + first, k, count), load_ring<F>(from.y + first, k, count),
           load_ring<F>(from.z + first, k, count)},
          load_ring<F>(from.score + first, k, count)};
}

/// Mask: 0 = ignored; nullptr = none.
struct ByteMask {
  const std::uint8_t* unmasked;
};
template <class F>
PMSP_HD MaskOf<F> is_unmasked(const ByteMask& mask, const IntOf<F>& index) {
  if (mask.unmasked == nullptr) return F(1) > F(0);
  return from_uint<F>(gather_bytes<F>(mask.unmasked, index)) > F(0);
}

/// View types of the CPU.
struct HostViewTypes {
  using Map = PlaneMapView;
  using Planes = PlaneArrays;
  using State = PlaneArrays;
  using Cube = CubeView;
  using Mask = ByteMask;
  using Landmarks = PlaneMapView;
  using Warped = PlaneMapView;
};

/// Map after the consistency filter: planes of the pixels with a confidence above 0.
template <class Map>
struct FilteredMap {
  Map planes;
  const float* confidence;
  int width, height;
};
template <class F, class Map>
PMSP_HD Vec3<F> plane_at(const FilteredMap<Map>& map, const IntOf<F>& index) {
  return select(gather<F>(map.confidence, index) > F(0), plane_at<F>(map.planes, index), Vec3<F>{F(0), F(0), F(0)});
}

/// Depth along a unit bearing; 1 if there is none.
template <class F>
struct Surface {
  MaskOf<F> known;
  F depth;
};
template <class F>
PMSP_HD Surface<F> surface_of(const Vec3<F>& plane, const Vec3<F>& bearing) {
  const F inverse_depth = dot(plane, bearing);
  const MaskOf<F> known = inverse_depth > F(0);
  return {known, F(1) / select(known, inverse_depth, F(1))};
}

}  // namespace pmsp::kernels
