// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "pmsp/types.h"
#include "synth/scene.h"

namespace pmsp::synth {

struct RenderOptions {
  int samples = 3;             ///< colour samples per pixel along each axis
  double gain = 1.0;           ///< exposure: factor on the colour
  double noise_sigma = 0.0;    ///< of the sensor, independent in each pixel and channel [gray levels]
  std::uint64_t seed = 1;      ///< of the noise
  int threads = 0;             ///< 0 = one for each CPU; without influence on the result
  double footprint_px = 1.0;   ///< side of what a pixel averages: blur, with `samples` enough
  double lens_distance = 0.0;  ///< DensifierOptions::lens_distance; the truth is that of one centre
  double vignetting = 0.0;     ///< of the light, what is lost where the two lenses meet
  double lens_gain = 0.0;      ///< by how much the backward lens is darker
  /// What a camera carries along, in its axes; no range where it is seen. nullptr = nothing. Must outlive the call.
  const Scene* rider = nullptr;
  double brightest =
      255.0;  ///< at which colour samples are cut [gray levels]; more: what is overexposed outshines edges
};

/// An equirectangular view with its truth; pixel conventions of pmsp/keyframe.h.
struct RenderedView {
  Image<Rgb> image;
  Image<float> depth;  ///< Euclidean distance along the ray of the pixel's centre [scene units]; 0 = no surface
  Image<Eigen::Vector3f>
      normal;                 ///< of the surface there: unit, camera frame, facing the camera; (0, 0, 0) = no surface
  Image<int> surface;         ///< Hit::surface there; -1 = no surface
  Image<std::uint8_t> label;  ///< Hit::label there; 0 = no surface, too
};

RenderedView render(const Scene& scene, const RigidTransform& cam_from_world, int width, int height,
                    const RenderOptions& options = {});

}  // namespace pmsp::synth
