// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/keyframe.h"
#include "pmsp/options.h"

namespace pmsp {

/// Parallax of the landmarks that two camera centres have in common.
struct CommonParallax {
  int landmarks = 0;        ///< observed from both
  int in_range = 0;         ///< with a parallax between the two angles
  double median_deg = 0.0;  ///< 0 without common landmarks
};

/// Parallax of a landmark = angle between the rays to it from the two centres. `a` and `b` need not be sorted.
PMSP_API CommonParallax common_parallax(const std::vector<Landmark>& a, const Eigen::Vector3d& center_a,
                                        const std::vector<Landmark>& b, const Eigen::Vector3d& center_b, double min_deg,
                                        double max_deg);

/// How sharply an image shows the surroundings of a landmark: squared differences of neighbouring pixels over the
/// variance of the patch, so that brightness and contrast do not matter. Blur lowers it.
struct LandmarkSharpness {
  std::int64_t id = 0;
  float horizontal = 0.0F;
  float vertical = 0.0F;
};

/// Accepts keyframes that see enough of what the newest accepted one saw from a usefully different place (Surmann et
/// al. 2022, section III-A). The first one is always accepted, and so is one that has landmarks but none in common, as
/// after a loss of tracking: it begins anew. One without landmarks is not.
///
/// Leaves out blurred ones too, where the keyframes around do without: while the newest accepted one shares half of its
/// landmarks and the parallax to it is below a quarter of `max_parallax_deg`. Landmarks seen in several images tell
/// blur from a lack of texture: the same spots lose their gradients.
class PMSP_API ViewFilter {
 public:
  /// `width`: of the depth maps, in whose pixels blur counts [px]; 0 = that of the images. Throws InvalidOption.
  explicit ViewFilter(const ViewFilterOptions& options, int width = 0);
  ~ViewFilter();
  ViewFilter(ViewFilter&&) noexcept;
  ViewFilter& operator=(ViewFilter&&) noexcept;

  /// Decides on the next keyframe; if accepted, it becomes the newest one. Without an image it counts as sharp.
  bool accept(const Keyframe& keyframe);

  /// Whether the last keyframe was left out for its blur alone.
  bool blurred() const;

  /// The next keyframe is accepted whatever it is.
  void reset();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
