// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::io {

constexpr int kPatchRadius = 4;  ///< patches are 9 x 9 samples
constexpr int kPatchSamples = (2 * kPatchRadius + 1) * (2 * kPatchRadius + 1);
constexpr int kBeside = 3;  ///< samples from a patch to those beside it

/// What an image shows around a point: gray values of zero mean and unit norm.
struct LandmarkPatch {
  std::array<float, kPatchSamples> values;
  bool flat = false;  ///< there is nothing to see, and the values mean nothing
};

/// Where a patch lies in an image [px]: its middle, and the steps from one sample to the next.
struct PatchPlace {
  Eigen::Vector2d centre, u, v;
};

/// Lays a patch that is fixed to the world into an image, so that turning, approaching and the panorama's stretch near
/// the poles don't make sightings of one landmark look different. Its columns follow `axis` of the world (0, 1, 2);
/// samples are `sample_rad` apart. False where that gives no finite place.
bool lay_patch(const RigidTransform& cam_from_world, const Eigen::Vector3d& to_landmark_world, int axis,
               double sample_rad, int width, int height, PatchPlace& out);

/// Columns wrap, rows end at the image's edge. The middle lies at most one width beside the image.
LandmarkPatch sample_patch(ImageView<const Rgb> image, const PatchPlace& place);

/// The patch, and those `kBeside` samples before and after it along u and v.
struct PatchWithNeighbours {
  LandmarkPatch here;
  std::array<LandmarkPatch, 4> beside;
};
PatchWithNeighbours sample_with_neighbours(ImageView<const Rgb> image, const PatchPlace& place);

/// Correlation, -1 to 1; of patches that are not flat.
float correlation(const LandmarkPatch& a, const LandmarkPatch& b);

}  // namespace pmsp::io
