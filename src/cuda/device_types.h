// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "confidence.h"
#include "depth_image.h"
#include "duplicates.h"
#include "fused_point.h"
#include "init.h"
#include "match.h"
#include "median.h"
#include "plane_image.h"
#include "plane_prior.h"
#include "ranges.h"
#include "weighted_median.h"

// Arguments of kernels. Pointers are device pointers. Images are row-major without padding unless stated otherwise.
namespace pmsp::cuda {

/// Gray values of a panorama for the texture units; 0 = none.
struct TextureCube {
  cudaTextureObject_t texture;
};

/// Plane map: x, y, z and score; zero plane = no estimate.
struct DevicePlanes {
  const float4* planes;
  int width, height;
};

/// Writable plane map, in row or checkerboard order.
struct DevicePlaneArray {
  float4* planes;
};

/// Keys of pixels (kernels/init.h).
struct DeviceKeys {
  std::uint64_t* keys;
};

/// Colours with a mask: the fourth byte of masked pixels is 0.
struct ColorMask {
  const uchar4* color;
};

/// View types of the device (kernels/stage.h).
struct DeviceViewTypes {
  using Map = DevicePlanes;
  using Planes = DevicePlaneArray;
  using State = DevicePlaneArray;
  using Cube = TextureCube;
  using Mask = ColorMask;
  using Landmarks = kernels::LandmarkPlanes;
  using Warped = kernels::WarpedPlanes<DevicePlanes>;
};

}  // namespace pmsp::cuda

template <>
struct pmsp::kernels::SurfaceOf<pmsp::cuda::TextureCube> {
  using Type = pmsp::cuda::DevicePlanes;
};

namespace pmsp::cuda {

/// Weights of the source pixels of each target column or row: `count` of them from first[i] on, padded with 0.
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
  uchar4* color;  ///< w = 255 for unmasked pixels, else 0; nullptr = not needed
  float* gray;    ///< nullptr = not needed
};

struct CubeArgs {
  int size;
  cudaSurfaceObject_t surface;
};

/// Counts of pixels by a stage.
struct Counts {
  static constexpr int kMost = 3;
  unsigned int of[kMost];
};

/// A point of the cloud, laid out as pmsp::CloudPoint.
struct DevicePoint {
  float position[3];
  float normal[3];
  unsigned char color[3];
  unsigned char views;
  float confidence;
};

/// Round of duplicate removal.
struct DuplicateArgs {
  kernels::DuplicateRound round;
  std::uint32_t* candidates;  ///< bits of each open pixel's candidate keyframes, before and after the round
  bool first;                 ///< `candidates` is not initialised yet
};

/// Kept points of a keyframe.
struct EmitArgs {
  kernels::GridView grid;
  kernels::ConstSurfelArrays map;
  DevicePoint* points;    ///< storage for all pixels, as `indices` and `agree`
  unsigned int* indices;  ///< of the points' pixels
  std::uint32_t* agree;
  unsigned int* count;
};

}  // namespace pmsp::cuda
