// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

namespace pmsp {

/// How far the two lenses of a camera are apart (DensifierOptions::lens_distance), as its own images tell.
struct LensDistance {
  double distance = 0.0;        ///< along the forward axis [scene units]
  double standard_error = 0.0;  ///< of `distance`
  double shift_px = 0.0;        ///< what it moves the landmarks in the images by, median [px of 1920]
  std::int64_t landmarks = 0;   ///< that took part: seen by both lenses, from places apart
  /// Whether to correct it: several standard errors, and a shift that can be seen.
  bool significant = false;
};

/// Estimates it from some keyframes, best from stretches of flight: a landmark that was in front and is behind, or to
/// the side of a turning camera, has been seen by both lenses. Patches around landmarks are looked up in other
/// keyframes, to a fraction of a pixel; then landmarks are triangulated anew from the directions found, with the
/// distance of the lenses as the one unknown that all have in common (a linear problem, from which each landmark's
/// place is eliminated). A SLAM that took the camera to have one centre has put landmarks wrong by about as much as the
/// lenses are off, so that its landmarks tell where to look, nothing more.
class PMSP_API LensDistanceEstimator {
 public:
  LensDistanceEstimator();
  ~LensDistanceEstimator();
  LensDistanceEstimator(LensDistanceEstimator&&) noexcept;
  LensDistanceEstimator& operator=(LensDistanceEstimator&&) noexcept;

  /// In the order of flight, with images; keeps a gray one of at most 2 MiB. `executor`: whose threads make it; nullptr
  /// = this one alone.
  void add(const Keyframe& keyframe, const Executor* executor = nullptr);

  /// Pose and landmarks of one that was added, as they are now; one that is not known is passed over.
  void move(const Keyframe& keyframe);

  /// Lets go of one; one that is not known is passed over.
  void remove(std::int64_t keyframe_id);

  std::size_t keyframes() const { return views_.size(); }
  std::size_t bytes() const;  ///< of the images and masks that it keeps

  /// Of all that were added. The same whatever the number of threads.
  LensDistance estimate(const Executor& executor) const;

 private:
  struct View;
  std::vector<std::unique_ptr<View>> views_;
};

/// Which of a mission's keyframes are enough: three stretches, at the beginning, in the middle and at the end.
/// `keyframe_ids`: in the order of flight.
PMSP_API std::vector<std::int64_t> keyframes_for_lens_distance(const std::vector<std::int64_t>& keyframe_ids);

/// Pixels that show what the camera carries along: a rig, a dashboard, the operator's head or hand.
struct RigMask {
  Image<std::uint8_t> mask;  ///< 0 = rig, 255 elsewhere, RigMaskEstimator::kWidth across; empty = no rig was found
  double share = 0.0;        ///< of the sphere that the rig covers, 0 to 1
};

/// Of a mask of kWidth x kWidth / 2 pixels, with its share of the sphere.
PMSP_API RigMask rig_mask_of(Image<std::uint8_t> mask);

/// Hides the rig in an image's mask of any size, too. `rig`: RigMask::mask; empty = changes nothing.
PMSP_API void hide_rig(const Image<std::uint8_t>& rig, Image<std::uint8_t>& mask);

/// Finds the rig from some keyframes: image gradients that keep their place in the camera's frame, while the poses say
/// that whatever the world shows there has moved, at infinity as at the distance of the landmarks. What looks alike
/// where that motion brings it proves nothing (an edge of a corridor, clouds), nor do places without texture.
/// Between such gradients and the nadir, or the zenith, all is rig that is not seen to move.
class PMSP_API RigMaskEstimator {
 public:
  static constexpr int kWidth = 512;                  ///< of the images that are compared [px]
  static constexpr std::size_t kFewestKeyframes = 6;  ///< with fewer nothing is found

  RigMaskEstimator();
  ~RigMaskEstimator();
  RigMaskEstimator(RigMaskEstimator&&) noexcept;
  RigMaskEstimator& operator=(RigMaskEstimator&&) noexcept;

  /// In the order of flight, with image; keeps 128 KiB of it. Pixels that its mask hides are no evidence.
  void add(const Keyframe& keyframe, const Executor& executor);

  /// Sets pose and landmarks of one that was added; ignores unknown ones.
  void move(const Keyframe& keyframe);

  /// Removes one; ignores unknown ones.
  void remove(std::int64_t keyframe_id);

  std::size_t keyframes() const { return views_.size(); }
  std::size_t bytes() const;  ///< of the images that it keeps

  /// Returns the rig that the keyframes added so far show. Independent of the number of threads.
  RigMask estimate(const Executor& executor) const;

 private:
  struct View;
  std::vector<std::unique_ptr<View>> views_;
};

/// What the values v of a depth image from elsewhere stand for, up to a scale and a shift.
enum class DepthModel {
  kScaled,   ///< depth = scale * v: lidar, metric networks, other reconstructions
  kDepth,    ///< depth = scale * v + shift
  kInverse,  ///< 1 / depth = scale * v + shift: disparities, what most networks give
  kWarped,   ///< 1 / depth = scale / v + shift: depth made of disparities whose shift was not known
};
PMSP_API const char* name_of(DepthModel model);  ///< for people: "inverse depth", ...

/// How a depth image fits a keyframe's landmarks.
struct DepthAlignment {
  DepthModel model = DepthModel::kScaled;
  double scale = 0.0;
  double shift = 0.0;
  std::size_t landmarks = 0;  ///< that have a value in the image
  double share = 0.0;         ///< of them, within 15 % of their depth
  double error = 0.0;         ///< median relative error of the depths of these
  std::string why_not;        ///< it does not fit; "" = it does
};

/// Finds scale (> 0) and shift of an image of values along each pixel's ray (0, or not finite = none) by the
/// keyframe's landmarks: of pairs of landmarks (RANSAC, the same pairs each time) for each model the one that most
/// agree with, then least squares of what agrees. The model with the smallest sum of relative errors (each at most
/// 15 %) is taken; kScaled where it is hardly worse. Left out is an image with fewer than 12 landmarks, one in which
/// less than 60 % of them agree, and one that tells little more than the same depth everywhere.
PMSP_API DepthAlignment align_prior_depth(ImageView<const float> values, const Keyframe& keyframe);

/// How depths compare with those of the keyframe's landmarks: the median of their ratios, > 0; 0 where fewer than 12
/// landmarks have a depth in the image.
PMSP_API double depth_ratio(ImageView<const float> depth, const Keyframe& keyframe);

/// The image as Keyframe::prior_depth takes it; 0 where it gives no depth > 0.
PMSP_API Image<float> aligned_depth(ImageView<const float> values, const DepthAlignment& alignment);

}  // namespace pmsp
