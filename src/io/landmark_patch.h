// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::io {

constexpr int kPatchRadius = 4;  ///< patches are 9 x 9 samples
constexpr int kPatchSamples = (2 * kPatchRadius + 1) * (2 * kPatchRadius + 1);
constexpr int kBeside = 3;  ///< offset of neighbouring patches [samples]

/// Image patch around a point: gray values of zero mean and unit norm.
struct LandmarkPatch {
  std::array<float, kPatchSamples> values;
  bool flat = false;  ///< without texture; values are meaningless
};

/// Position of a patch in an image: centre and steps between samples [px].
struct PatchPlace {
  Eigen::Vector2d centre, u, v;
};

/// Places a patch that is fixed in the world, so that its appearance is independent of rotation, distance and the
/// panorama's distortion near the poles. Columns follow `axis` of the world (0, 1, 2); samples are `sample_rad` apart.
/// False if degenerate.
bool lay_patch(const RigidTransform& cam_from_world, const Eigen::Vector3d& to_landmark_world, int axis,
               double sample_rad, int width, int height, PatchPlace& out);

/// Samples a patch; columns wrap, rows are clamped. The centre is at most one width outside the image.
LandmarkPatch sample_patch(ImageView<const Rgb> image, const PatchPlace& place);

/// Patch with those `kBeside` samples before and after it along u and v.
struct PatchWithNeighbours {
  LandmarkPatch here;
  std::array<LandmarkPatch, 4> beside;
};
PatchWithNeighbours sample_with_neighbours(ImageView<const Rgb> image, const PatchPlace& place);

/// Correlation of two textured patches, -1 to 1.
float correlation(const LandmarkPatch& a, const LandmarkPatch& b);

}  // namespace pmsp::io
