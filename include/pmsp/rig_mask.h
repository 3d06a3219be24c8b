// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/image.h"
#include "pmsp/keyframe.h"

namespace pmsp {

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

}  // namespace pmsp
