// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "cpu/row_kernels.h"
#include "fused_point.h"
#include "ownership.h"
#include "patchmatch.h"
#include "plane_prior.h"

// What kernels are called with. Pointers are device pointers. Images are row-major without padding unless it says
// otherwise.
namespace pmsp::cuda {

constexpr int kMaxMaps = 30;  ///< other maps that one map is compared with

/// A panorama's gray values as the texture units see them; 0 = none.
struct TextureCube {
  cudaTextureObject_t texture;
};

/// A depth map's planes: x, y, z and the photometric score; zero plane = no estimate.
struct DevicePlanes {
  const float4* planes;
  int width, height;
};

/// A depth map after the consistency filter: planes of pixels with a confidence above 0.
struct FilteredPlanes {
  const float4* planes;
  const float* confidence;
  int width, height;
};

}  // namespace pmsp::cuda

template <>
struct pmsp::kernels::SurfaceOf<pmsp::cuda::TextureCube> {
  using Type = pmsp::cuda::DevicePlanes;
};

namespace pmsp::cuda {

/// A landmark that a keyframe observes: where it is seen [px], and the plane through it that faces the camera.
struct SparsePoint {
  float x, y;
  float plane_x, plane_y, plane_z;
};

/// Weights of the source pixels of each target column or row: `count` of them from first[i] on, the rest 0.
struct DeviceSpans {
  const int* first;
  const float* weights;  ///< [target][count]
  int count;
};

struct ResizeArgs {
  const unsigned char* image;  ///< RGB
  const unsigned char* mask;   ///< nullptr = none
  int source_width, source_height;
  int width, height;
  DeviceSpans columns, rows;
  uchar4* color;  ///< w = 255 where a depth is wanted, else 0
  float* gray;
};

struct CubeArgs {
  int size;
  cudaSurfaceObject_t surface;
};

/// Plane priors of a keyframe.
struct PriorArgs {
  TextureCube image;
  cpu::GridTables grid;
  float spacing;  ///< of the samples by which texture is judged
  kernels::PriorCells<DevicePlanes> cells;
  float* variance;  ///< that of `cells`
  float4* priors;   ///< per pixel, row order; zero = none
};

/// A keyframe's match.
struct MatchArgs {
  kernels::Matching<TextureCube> matching;
  cpu::GridTables grid;
  float4* state;                     ///< plane and score, checkerboard order (SphereGrid)
  const float4* priors;              ///< planes that pixels without texture prefer, row order; nullptr = none
  const uchar4* color;               ///< of the reference
  const std::uint64_t* sparse_keys;  ///< per pixel: (distance, index of the landmark), ~0 = none; nullptr = not wanted
  const SparsePoint* sparse_points;
  const std::uint64_t* warp_keys;  ///< per pixel: (range, index of the previous map's pixel), ~0 = none; or nullptr
  const float4* previous;          ///< planes of the previous map
  kernels::Rigid previous_from_reference;
};

struct SplatArgs {
  const SparsePoint* points;
  int count;
  int width, height;
  float radius;
  std::uint64_t* keys;
};

struct WarpArgs {
  cpu::GridTables grid;
  const float4* planes;
  kernels::Rigid reference_from_previous;
  int width, height;  ///< of the keys, which may be fewer than the planes
  std::uint64_t* keys;
};

/// Numbers of pixels, added up over a keyframe.
struct Counts {
  unsigned int pixels;
  unsigned int matched;
  unsigned int after_median;
  unsigned int after_consistency;
  unsigned int fused;
  unsigned int eligible;
  unsigned int points;
};

/// A depth map as the host wants it; nullptr = not wanted.
struct MapArrays {
  float* depth;
  float* normal;  ///< three a pixel
  float* confidence;
};

struct MedianArgs {
  cpu::GridTables grid;
  const float4* raw;
  const uchar4* color;
  bool enabled;
  float max_relative_deviation;
  float min_score;
  float4* planes;
  Counts* counts;  ///< nullptr = not wanted
};

/// One other keyframe's map.
struct OtherMap {
  const float4* planes;
  kernels::Rigid other_from_first;
};

struct ConsistencyArgs {
  cpu::GridTables grid;
  const float4* planes;
  OtherMap others[kMaxMaps];
  int num_others;
  bool enabled;
  int wanted;
  float tolerance;
  float pixel_angle;  ///< at the equator [rad]
  float* confidence;  ///< 0 = no depth
  MapArrays out;
  Counts* counts;
};

/// A point of the cloud, laid out as pmsp::CloudPoint.
struct DevicePoint {
  float position[3];
  float normal[3];
  unsigned char color[3];
  unsigned char views;
  float confidence;
};

/// A keyframe's points in row order; see SurfelMap.
struct SurfelArrays {
  std::uint32_t* surfels;
  std::uint32_t* details;
  std::uint8_t* standings;
  std::uint32_t* agree;  ///< bit k: others[k]
};

struct SurfelArgs {
  cpu::GridTables grid;
  kernels::FusionView<FilteredPlanes> first;  ///< its pose is not looked at
  kernels::FusionView<FilteredPlanes> others[kernels::kMaxAgree];
  int num_others;
  kernels::FusionLimits limits;
  SurfelArrays to;
  Counts* counts;
};

/// Sight of a keyframe (SightMap), half as wide and high as its map.
struct SightArgs {
  cpu::GridTables grid;  ///< of the map
  FilteredPlanes map;
  float* nearest;
  float* farthest;
};

struct JudgeArgs {
  cpu::GridTables grid;
  const std::uint32_t* surfels;
  const std::uint32_t* details;
  kernels::Viewer viewers[kernels::kMaxViewers];
  int num_viewers;
  kernels::SightLimits limits;
  float max_contradiction;
  std::uint8_t* standings;
  Counts* counts;
};

/// A round of ownership of one keyframe.
struct OwnershipArgs {
  cpu::GridTables grid;
  kernels::SurfelView map;
  kernels::OwnershipView others[kernels::kMaxViewers];
  int num_others;
  bool first;  ///< round: nobody is an owner yet
  kernels::OwnershipLimits limits;
  std::uint8_t* standings;  ///< after the round; not those of `map`
};

/// The points that a keyframe makes.
struct OwnedArgs {
  cpu::GridTables grid;
  SurfelArrays map;
  DevicePoint* points;    ///< room for all pixels, as the next two have
  unsigned int* indices;  ///< of the points' pixels
  std::uint32_t* agree;
  unsigned int* count;
};

}  // namespace pmsp::cuda
