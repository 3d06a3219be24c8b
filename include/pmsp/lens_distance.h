// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/executor.h"
#include "pmsp/keyframe.h"

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

}  // namespace pmsp
