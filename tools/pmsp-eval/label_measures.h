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

/// What the pixels of the truth show, as pmsp-synth writes it to label/. Other values are possible and have no name.
enum Label : int { kAllLabels = -1, kOther, kThin, kGlossy, kBehindGlass, kSky, kRider, kMover };

/// "all", "other", "thin", "glossy", "behind glass", "sky", "rider", "mover", "label 7" and so on.
std::string label_name(int label);

struct LabelOptions {
  double scale = 1.0;                ///< metres per unit of the estimate, > 0
  double max_relative_error = 0.05;  ///< an estimate is wrong beyond it; > 0
  double max_offset = 0.1;           ///< and behind or in front of the truth beyond this, relative to it; > 0
  int beside_px = 5;                 ///< what lies beside a thin thing: half a patch [px of the estimate], >= 0
};

/// Solid angles of the pixels with a label and a true range, up to a factor common to all. Pixels of kSky and kRider
/// have none: each estimate is wrong, and in front.
struct LabelMeasures {
  double pixels = 0.0;
  double estimates = 0.0;  ///< those of them with an estimate
  double wrong = 0.0;
  double behind = 0.0;  ///< farther than the truth
  double in_front = 0.0;
  double beside = 0.0;  ///< kThin only: of the pixels without that label beside it
  double grown = 0.0;   ///< kThin only: of those of them that have its range and not their own

  double missing_share() const { return share(pixels - estimates, pixels); }
  double wrong_share() const { return share(wrong, pixels); }
  double behind_share() const { return share(behind, estimates); }  ///< of the estimates
  double in_front_share() const { return share(in_front, estimates); }
  double grown_share() const { return share(grown, beside); }

  LabelMeasures& operator+=(const LabelMeasures& other);

 private:
  static double share(double part, double of) { return of > 0.0 ? part / of : 0.0; }
};

/// By label, kAllLabels first.
using LabelTable = std::map<int, LabelMeasures>;

LabelTable& operator+=(LabelTable& sum, const LabelTable& table);

/// `estimate` of any size, 0 where there is none; `error` as from relative_error for it (NaN also where there is no
/// estimate), which on thin things is taken without slack: that would accept the wall beside them. `truth` [m] and
/// `labels` of any size. Without labels only kAllLabels is measured.
LabelTable measure_labels(const Image<float>& estimate, const Image<float>& error, const Image<float>& truth,
                          const Image<std::uint8_t>& labels, const LabelOptions& options = {});

/// The truth as a keyframe sees it.
struct TrueView {
  RigidTransform cam_from_world;
  Image<float> range;          ///< [m]
  Image<std::uint8_t> labels;  ///< empty, or of the range's size
};

/// Points that at least one view sees in front of the sky, or of a mover and of what is behind that by more than
/// `max_relative_error` of its true range, with such pixels all around. Counted under kSky and kMover; a point may be
/// counted under both.
std::map<int, std::size_t> count_floating(const std::vector<Eigen::Vector3f>& points,
                                          const std::vector<TrueView>& views, double max_relative_error, int threads);

/// Points that lie behind the true surface from everywhere: by more than `max_offset` of the true range for each view
/// that knows a range in their direction. What some view sees as it should, or in front of the surface, is not among
/// them. Counted under kAllLabels and under the label of the surface that they lie least behind.
std::map<int, std::size_t> count_behind(const std::vector<Eigen::Vector3f>& points, const std::vector<TrueView>& views,
                                        double max_offset, int threads);

}  // namespace pmsp::eval
