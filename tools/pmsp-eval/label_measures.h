// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"

namespace pmsp::eval {

/// Classes of pixels in the truth, as in pmsp-synth's label/. Other values are allowed and have no name.
enum Label : int { kAllLabels = -1, kOther, kThin, kGlossy, kBehindGlass, kSky, kRider, kMover };

/// Returns "all", "other", "thin", "glossy", "behind glass", "sky", "rider", "mover", "label 7" and so on.
std::string label_name(int label);

struct LabelOptions {
  double scale = 1.0;                ///< metres per unit of the estimate, > 0
  double max_relative_error = 0.05;  ///< limit of correct estimates; > 0
  double max_offset = 0.1;           ///< limit for behind or in front of the truth [true range]; > 0
  int beside_px = 5;                 ///< neighbourhood of thin structures: half a patch [px of the estimate], >= 0
};

/// Solid angles of pixels with a label and a true range, up to a common factor. kSky and kRider have no true range:
/// every estimate is wrong, and in front.
struct LabelMeasures {
  double pixels = 0.0;
  double estimates = 0.0;  ///< with an estimate
  double wrong = 0.0;
  double behind = 0.0;  ///< farther than the truth
  double in_front = 0.0;
  double beside = 0.0;  ///< kThin only: pixels beside it without that label
  double grown = 0.0;   ///< kThin only: those of `beside` with its range instead of their own

  double missing_share() const { return share(pixels - estimates, pixels); }
  double wrong_share() const { return share(wrong, pixels); }
  double behind_share() const { return share(behind, estimates); }  ///< of estimates
  double in_front_share() const { return share(in_front, estimates); }
  double grown_share() const { return share(grown, beside); }

  LabelMeasures& operator+=(const LabelMeasures& other);

 private:
  static double share(double part, double of) { return of > 0.0 ? part / of : 0.0; }
};

/// By label, kAllLabels first.
using LabelTable = std::map<int, LabelMeasures>;

LabelTable& operator+=(LabelTable& sum, const LabelTable& table);

/// `estimate`: any size, 0 = none; `error`: of relative_error for it (NaN also without estimate), for thin structures
/// recomputed without slack, which would accept the wall beside them. `truth` [m], `labels`: any size. Without labels
/// only kAllLabels is measured.
LabelTable measure_labels(const Image<float>& estimate, const Image<float>& error, const Image<float>& truth,
                          const Image<std::uint8_t>& labels, const LabelOptions& options = {});

/// Truth in the view of a keyframe.
struct TrueView {
  RigidTransform cam_from_world;
  Image<float> range;          ///< [m]
  Image<std::uint8_t> labels;  ///< empty, or of the size of `range`
};

/// Counts points that at least one view sees in front of sky, or of a mover and by more than `max_relative_error` of
/// the true range of the background behind it, with such pixels all around. By kSky and kMover, possibly both.
std::map<int, std::size_t> count_floating(const std::vector<Eigen::Vector3f>& points,
                                          const std::vector<TrueView>& views, double max_relative_error, int threads);

/// Counts points behind the true surface in all views: by more than `max_offset` of the true range, in each view with a
/// range in their direction. By kAllLabels and by the label of the surface that they are least behind.
std::map<int, std::size_t> count_behind(const std::vector<Eigen::Vector3f>& points, const std::vector<TrueView>& views,
                                        double max_offset, int threads);

}  // namespace pmsp::eval
