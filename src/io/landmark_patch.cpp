// SPDX-License-Identifier: BSD-2-Clause
#include "landmark_patch.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>

#include "pmsp/camera.h"
#include "util/patch_correlation.h"

namespace pmsp::io {
namespace {

/// Minimum standard deviation [gray levels]; flatter patches contain no keypoint.
constexpr double kFlatDeviation = 1.0;

float gray(const Rgb& c) { return 0.299F * c.r + 0.587F * c.g + 0.114F * c.b; }

/// Bilinear gray value; `x`, `y` from the image's corner [px], x at most a few widths outside.
float sample_gray(ImageView<const Rgb> image, double x, double y) {
  const double fx = x - 0.5;
  const double fy = std::clamp(y - 0.5, 0.0, image.height - 1.0);
  int x0 = static_cast<int>(fx + 4.0 * image.width) - 4 * image.width;  // rounds down
  const auto ax = static_cast<float>(fx - x0);
  while (x0 < 0) x0 += image.width;
  while (x0 >= image.width) x0 -= image.width;
  const int x1 = x0 + 1 < image.width ? x0 + 1 : 0;
  const auto y0 = static_cast<int>(fy);
  const int y1 = std::min(y0 + 1, image.height - 1);
  const auto ay = static_cast<float>(fy - y0);
  return (1.0F - ay) * ((1.0F - ax) * gray(image(x0, y0)) + ax * gray(image(x1, y0))) +
         ay * ((1.0F - ax) * gray(image(x0, y1)) + ax * gray(image(x1, y1)));
}

float sample(ImageView<const Rgb> image, const PatchPlace& place, int col, int row) {
  const Eigen::Vector2d at = place.centre + col * place.u + row * place.v;
  return sample_gray(image, at.x(), at.y());
}

void normalise(LandmarkPatch& patch) {
  double sum = 0.0;
  double squares = 0.0;
  for (const float v : patch.values) {
    sum += v;
    squares += static_cast<double>(v) * v;
  }
  const double mean = sum / kPatchSamples;
  const double variance = squares / kPatchSamples - mean * mean;
  patch.flat = !(variance > kFlatDeviation * kFlatDeviation);
  if (patch.flat) return;
  const double scale = 1.0 / std::sqrt(variance * kPatchSamples);
  for (float& v : patch.values) v = static_cast<float>((v - mean) * scale);
}

}  // namespace

bool lay_patch(const RigidTransform& cam_from_world, const Eigen::Vector3d& to_landmark_world, int axis,
               double sample_rad, int width, int height, PatchPlace& out) {
  const Eigen::Vector3d direction = to_landmark_world.normalized();
  const Eigen::Vector3d u = Eigen::Vector3d::Unit(axis).cross(direction).normalized();
  const Eigen::Vector3d v = direction.cross(u);
  const double reach = sample_rad * kPatchRadius;
  const Eigen::Matrix3d& rotation = cam_from_world.rotation;
  out.centre = pixel_from_bearing(rotation * direction, width, height);
  const auto step = [&](const Eigen::Vector3d& tangent) {
    Eigen::Vector2d d = pixel_from_bearing(rotation * (direction + reach * tangent), width, height) - out.centre;
    d.x() -= width * std::round(d.x() / width);
    return Eigen::Vector2d(d / kPatchRadius);
  };
  out.u = step(u);
  out.v = step(v);
  return out.centre.allFinite() && out.u.allFinite() && out.v.allFinite();
}

LandmarkPatch sample_patch(ImageView<const Rgb> image, const PatchPlace& place) {
  LandmarkPatch patch;
  std::size_t i = 0;
  for (int row = -kPatchRadius; row <= kPatchRadius; ++row)
    for (int col = -kPatchRadius; col <= kPatchRadius; ++col) patch.values[i++] = sample(image, place, col, row);
  normalise(patch);
  return patch;
}

PatchWithNeighbours sample_with_neighbours(ImageView<const Rgb> image, const PatchPlace& place) {
  constexpr int kReach = kPatchRadius + kBeside;
  constexpr int kSamplesAlong = 2 * kReach + 1;
  std::array<float, kSamplesAlong * kSamplesAlong> grid;
  std::size_t i = 0;
  for (int row = -kReach; row <= kReach; ++row)
    for (int col = -kReach; col <= kReach; ++col) grid[i++] = sample(image, place, col, row);
  const auto cut = [&grid](int col, int row) {
    LandmarkPatch patch;
    std::size_t k = 0;
    for (int r = -kPatchRadius; r <= kPatchRadius; ++r)
      for (int c = -kPatchRadius; c <= kPatchRadius; ++c)
        patch.values[k++] = grid[static_cast<std::size_t>((row + r + kReach) * kSamplesAlong + col + c + kReach)];
    normalise(patch);
    return patch;
  };
  return {cut(0, 0), {cut(kBeside, 0), cut(-kBeside, 0), cut(0, kBeside), cut(0, -kBeside)}};
}

float correlation(const LandmarkPatch& a, const LandmarkPatch& b) { return pmsp::correlation(a.values, b.values); }

}  // namespace pmsp::io
