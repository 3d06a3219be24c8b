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

/// Estimated distance of the two lenses of a camera, see DensifierOptions::lens_distance.
struct LensDistance {
  double distance = 0.0;        ///< along the forward axis [map units]
  double standard_error = 0.0;  ///< of `distance` [map units]
  double shift_px = 0.0;        ///< median displacement of landmarks in the images [px of 1920]
  std::int64_t landmarks = 0;   ///< number of landmarks used, seen by both lenses from different positions
  bool significant = false;     ///< to be corrected: above five standard errors, and half a pixel of shift
};

/// Estimator of the lens distance from keyframes in consecutive groups, in which both lenses see the same landmarks
/// from different positions. Patches around landmarks are located to subpixel accuracy in adjacent keyframes; landmarks
/// are triangulated again with the lens distance as common unknown, and their positions eliminated (linear least
/// squares). Positions from a SLAM that assumes one centre are biased, and used only as search positions.
class PMSP_API LensDistanceEstimator {
 public:
  LensDistanceEstimator();
  ~LensDistanceEstimator();
  LensDistanceEstimator(LensDistanceEstimator&&) noexcept;
  LensDistanceEstimator& operator=(LensDistanceEstimator&&) noexcept;

  /// Adds a keyframe with image, in temporal order; stores a gray image of at most 2 MiB, and the mask. `executor`:
  /// threads for the conversion; nullptr = calling thread.
  void add(const Keyframe& keyframe, const Executor* executor = nullptr);

  void move(const Keyframe& keyframe);  ///< sets pose and landmarks; ignores unknown ids

  void remove(std::int64_t keyframe_id);  ///< ignores unknown ids

  std::size_t keyframes() const { return views_.size(); }
  std::size_t bytes() const;  ///< memory of images and masks [bytes]

  LensDistance estimate(const Executor& executor) const;  ///< from all keyframes; independent of the number of threads

 private:
  struct View;
  std::vector<std::unique_ptr<View>> views_;
};

/// Selects at most 24 keyframes for both estimators: groups of eight from beginning, middle and end. Temporal order.
PMSP_API std::vector<std::int64_t> keyframes_for_lens_distance(const std::vector<std::int64_t>& keyframe_ids);

/// Mask of objects that move with the camera: a rig, a dashboard, the operator's head or hand.
struct RigMask {
  Image<std::uint8_t> mask;  ///< 0 = rig, else 255; of width RigMaskEstimator::kWidth; empty = no rig found
  double share = 0.0;        ///< share of the sphere covered by the rig, 0 to 1
};

/// Computes the share of a mask of RigMaskEstimator::kWidth x kWidth / 2 pixels.
PMSP_API RigMask rig_mask_of(Image<std::uint8_t> mask);

/// Adds a rig to a mask of any size. `rig`: RigMask::mask; empty = no effect.
PMSP_API void hide_rig(const Image<std::uint8_t>& rig, Image<std::uint8_t>& mask);

/// Estimator of the rig mask: image gradients that keep their position in the camera frame, although poses imply motion
/// both at infinity and at the distance of the landmarks. Textureless pixels are no evidence, nor are gradients that
/// also match at the displaced position (edge of a corridor, clouds). Regions extend to the nadir or the zenith over
/// pixels without observed motion.
class PMSP_API RigMaskEstimator {
 public:
  static constexpr int kWidth = 512;                  ///< width of the compared images [px]
  static constexpr std::size_t kFewestKeyframes = 6;  ///< minimum number for an estimate

  RigMaskEstimator();
  ~RigMaskEstimator();
  RigMaskEstimator(RigMaskEstimator&&) noexcept;
  RigMaskEstimator& operator=(RigMaskEstimator&&) noexcept;

  /// Adds a keyframe with image, in temporal order; stores 128 KiB. Masked pixels are ignored.
  void add(const Keyframe& keyframe, const Executor& executor);

  void move(const Keyframe& keyframe);  ///< sets pose and landmarks; ignores unknown ids

  void remove(std::int64_t keyframe_id);  ///< ignores unknown ids

  std::size_t keyframes() const { return views_.size(); }
  std::size_t bytes() const;  ///< memory of images [bytes]

  RigMask estimate(const Executor& executor) const;  ///< from all keyframes; independent of the number of threads

 private:
  struct View;
  std::vector<std::unique_ptr<View>> views_;
};

/// Meaning of the values v of a prior depth image, up to scale and shift.
enum class DepthModel {
  kScaled,   ///< depth = scale * v: lidar, metric networks, reconstructions
  kDepth,    ///< depth = scale * v + shift
  kInverse,  ///< 1 / depth = scale * v + shift: disparity, most networks
  kWarped,   ///< 1 / depth = scale / v + shift: depth from disparity of unknown shift
};
PMSP_API const char* name_of(DepthModel model);  ///< for messages: "inverse depth", ...

/// Alignment of a depth image to the landmarks of a keyframe.
struct DepthAlignment {
  DepthModel model = DepthModel::kScaled;
  double scale = 0.0;
  double shift = 0.0;
  std::size_t landmarks = 0;  ///< number of landmarks with a value in the image
  double share = 0.0;         ///< share of these within 15 % of their depth
  double error = 0.0;         ///< median relative error of the latter
  std::string why_not;        ///< reason of rejection; "" = accepted
};

/// Estimates scale (> 0) and shift of values along the rays (0 or not finite = none) by the landmarks: for each model
/// RANSAC over pairs (deterministic), then least squares of the inliers. The model with the smallest sum of relative
/// errors (each clamped to 15 %) is selected, or kScaled if hardly worse. Images with fewer than 12 landmarks, less
/// than 60 % inliers, or hardly smaller errors than a constant depth are rejected.
PMSP_API DepthAlignment align_prior_depth(ImageView<const float> values, const Keyframe& keyframe);

/// Returns the median ratio, > 0, of depths of image and landmarks; 0 with fewer than 12 landmarks in the image.
PMSP_API double depth_ratio(ImageView<const float> depth, const Keyframe& keyframe);

/// Returns the aligned image as Keyframe::prior_depth; 0 where the depth is not positive.
PMSP_API Image<float> aligned_depth(ImageView<const float> values, const DepthAlignment& alignment);

}  // namespace pmsp
