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

// What kernels are called with. Pointers are device pointers. Images are row-major without padding unless it says
// otherwise.
namespace pmsp::cuda {

/// A panorama's gray values as the texture units see them; 0 = none.
struct TextureCube {
  cudaTextureObject_t texture;
};

/// A depth map's planes: x, y, z and the photometric score; zero plane = no estimate.
struct DevicePlanes {
  const float4* planes;
  int width, height;
};

/// The same, to be written, in row or checkerboard order.
struct DevicePlaneArray {
  float4* planes;
};

/// Keys of pixels (kernels/init.h).
struct DeviceKeys {
  std::uint64_t* keys;
};

/// Colours, with 0 as the fourth byte where no depth is wanted.
struct ColorMask {
  const uchar4* color;
};

/// The device's views (kernels/stage.h).
struct DeviceMachine {
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
  uchar4* color;  ///< w = 255 where a depth is wanted, else 0; nullptr = not asked for
  float* gray;    ///< nullptr = not asked for
};

struct CubeArgs {
  int size;
  cudaSurfaceObject_t surface;
};

/// Numbers of pixels that a stage counts.
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

/// A round of ownership.
struct DuplicateArgs {
  kernels::DuplicateRound round;
  std::uint32_t*
      candidates;  ///< of open pixels a bit for each keyframe whose say matters, before the round and after it
  bool first;      ///< `asked` holds nothing yet
};

/// The points that a keyframe makes.
struct OwnedArgs {
  kernels::GridView grid;
  kernels::ConstSurfelArrays map;
  DevicePoint* points;    ///< room for all pixels, as the next two have
  unsigned int* indices;  ///< of the points' pixels
  std::uint32_t* agree;
  unsigned int* count;
};

}  // namespace pmsp::cuda
