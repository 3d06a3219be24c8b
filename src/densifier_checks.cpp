// SPDX-License-Identifier: BSD-2-Clause
#include "densifier_checks.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

#include <Eigen/LU>

#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

/// Maximum default width [px]; beyond it depth maps gain no accuracy from pixels.
constexpr int kLargestWidth = 5760;
constexpr int kEnlargedUpTo = 1440;

/// Whether products of coordinates stay within the range of single precision.
bool is_reasonable(const Eigen::Vector3d& position) { return position.norm() <= kMaxPosition; }

int even(int value) { return std::max(2, value / 2 * 2); }

/// Small images gain from larger depth maps: patches are smaller, and planes lie between pixels anyway.
int width_for(int image_width) {
  const int enlarged = std::min(image_width + image_width / 2, kEnlargedUpTo);
  return even(std::min(std::max(image_width, enlarged), kLargestWidth));
}

}  // namespace

void check_keyframe(const Keyframe& keyframe) {
  const std::string who = "keyframe " + std::to_string(keyframe.id) + ": ";
  check_sizes(who, keyframe.image.width, keyframe.image.height, keyframe.mask);
  if (keyframe.image.empty()) throw InvalidInput(who + "there is no image; expected pixels");
  check_prior_depth(who, keyframe.prior_depth);
  check_pose(who, keyframe.cam_from_world);
  check_scale(who, keyframe.scale);
  check_landmarks(who, keyframe.landmarks);
  check_pose_error(who, keyframe.pose_error);
}

void check_prior_depth(const std::string& where, ImageView<const float> prior) {
  if (prior.empty() || (prior.width >= 16 && prior.height >= 8)) return;
  throw InvalidInput(where + "the prior depth is " + size_text(prior.width, prior.height) +
                     "; expected 16 x 8 at least, or none");
}

void check_sizes(const std::string& where, int image_width, int image_height, ImageView<const std::uint8_t> mask) {
  if (image_width < 16 || image_height < 8 || image_width % 2 != 0 || image_height % 2 != 0) {
    throw InvalidInput(where + "the image is " + size_text(image_width, image_height) +
                       "; expected an even width from 16 and an even height from 8");
  }
  if (!mask.empty() && (mask.width != image_width || mask.height != image_height)) {
    throw InvalidInput(where + "the mask is " + size_text(mask.width, mask.height) + ", the image " +
                       size_text(image_width, image_height) + "; expected equal sizes");
  }
}

void check_pose(const std::string& where, const RigidTransform& cam_from_world) {
  const Eigen::Matrix3d& r = cam_from_world.rotation;
  const bool rotation =
      r.allFinite() && (r * r.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3 && r.determinant() > 0;
  if (rotation && is_reasonable(cam_from_world.translation)) return;
  throw InvalidInput(where +
                     "cam_from_world is no rigid transform; expected an orthonormal rotation and a translation "
                     "within 1e12 map units");
}

void check_landmarks(const std::string& where, const std::vector<Landmark>& landmarks) {
  for (const Landmark& landmark : landmarks) {
    if (is_reasonable(landmark.position_world)) continue;
    throw InvalidInput(where + "landmark " + std::to_string(landmark.id) +
                       " is not at a finite position within 1e12 map units");
  }
}

void check_pose_error(const std::string& where, double error) {
  if (error >= 0.0 && error <= 1.0) return;
  std::ostringstream text;
  text << where << "the pose error is " << error << "; expected 0 to 1 rad";
  throw InvalidInput(text.str());
}

void check_scale(const std::string& where, double scale) {
  if (scale >= 1.0 / kMaxScale && scale <= kMaxScale) return;
  std::ostringstream text;
  text << where << "the scale is " << scale << "; expected " << 1.0 / kMaxScale << " to " << kMaxScale
       << ": give the world a unit nearer to that of the keyframes";
  throw InvalidInput(text.str());
}

void fill_in_size(DensifierOptions& options, int image_width, int image_height) {
  if (options.width != 0 && options.height != 0) return;
  if (options.width == 0) {
    options.width = options.height != 0 ? 2 * options.height : width_for(image_width);
  }
  if (options.height == 0) {
    const double height = static_cast<double>(options.width) * image_height / image_width;
    options.height = even(static_cast<int>(std::min(std::round(height), 1e6)));
  }
  try {
    options.validate();
  } catch (const InvalidOption& error) {
    throw InvalidInput("for images of " + size_text(image_width, image_height) + " " + error.what() +
                       "; give width and height");
  }
}

}  // namespace pmsp
