// SPDX-License-Identifier: BSD-2-Clause
#include "densifier_checks.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/LU>

#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Native resolution stops here; beyond it a depth map no longer gains from pixels.
constexpr int kLargestWidth = 5760;

std::string size_text(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

int even(int value) { return std::max(2, value / 2 * 2); }

}  // namespace

void check_keyframe(const Keyframe& keyframe) {
  const std::string who = "keyframe " + std::to_string(keyframe.id) + ": ";
  const auto& image = keyframe.image;
  const auto& mask = keyframe.mask;
  if (image.empty() || image.width % 2 != 0 || image.height % 2 != 0) {
    throw InvalidInput(who + "the image is " + size_text(image.width, image.height) +
                       "; expected an even width and height");
  }
  if (!mask.empty() && (mask.width != image.width || mask.height != image.height)) {
    throw InvalidInput(who + "the mask is " + size_text(mask.width, mask.height) + ", the image " +
                       size_text(image.width, image.height) + "; expected equal sizes");
  }
  const Eigen::Matrix3d& r = keyframe.cam_from_world.rotation;
  const bool rotation =
      r.allFinite() && (r * r.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3 && r.determinant() > 0;
  if (!rotation || !keyframe.cam_from_world.translation.allFinite()) {
    throw InvalidInput(who +
                       "cam_from_world is no rigid transform; expected an orthonormal rotation and finite numbers");
  }
  for (const Landmark& landmark : keyframe.landmarks) {
    if (!landmark.position_world.allFinite()) {
      throw InvalidInput(who + "landmark " + std::to_string(landmark.id) + " has a position that is not finite");
    }
  }
}

void fill_in_size(DensifierOptions& options, int image_width, int image_height) {
  if (options.width == 0) {
    options.width = options.height != 0 ? 2 * options.height : even(std::min(image_width, kLargestWidth));
  }
  if (options.height == 0) {
    options.height =
        even(static_cast<int>(std::lround(static_cast<double>(options.width) * image_height / image_width)));
  }
}

}  // namespace pmsp
