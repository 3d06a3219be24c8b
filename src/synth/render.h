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
  double noise_sigma = 0.0;    ///< standard deviation of sensor noise, independent per pixel and channel [gray levels]
  std::uint64_t seed = 1;      ///< of the noise
  int threads = 0;             ///< 0 = one per CPU; no effect on the result
  double footprint_px = 1.0;   ///< side of the area that a pixel averages (blur; requires enough `samples`)
  double lens_distance = 0.0;  ///< DensifierOptions::lens_distance; the truth is from one centre
  double vignetting = 0.0;     ///< relative loss of light where the two lenses meet
  double lens_gain = 0.0;      ///< relative loss of light of the backward lens
  /// Objects that move with the camera, in its axes; without depth. nullptr = none. Must outlive the call.
  const Scene* rider = nullptr;
  double brightest = 255.0;  ///< maximum of colour samples [gray levels]; with more, overexposed areas outshine edges
};

/// Equirectangular view with ground truth; pixels as in docs/conventions.md.
struct RenderedView {
  Image<Rgb> image;
  Image<float> depth;             ///< distance along the ray of the pixel's centre [m]; 0 = no surface
  Image<Eigen::Vector3f> normal;  ///< unit, camera frame, facing the camera; (0, 0, 0) = no surface
  Image<int> surface;             ///< Hit::surface; -1 = no surface
  Image<std::uint8_t> label;      ///< Hit::label; also 0 if there is no surface
};

RenderedView render(const Scene& scene, const RigidTransform& cam_from_world, int width, int height,
                    const RenderOptions& options = {});

}  // namespace pmsp::synth
