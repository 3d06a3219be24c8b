// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "pmsp-eval/alignment.h"
#include "pmsp-eval/cloud_measures.h"
#include "pmsp-eval/ground_truth.h"
#include "pmsp-eval/label_measures.h"

namespace pmsp::eval {

struct ViewOptions {
  int height = 360;                  ///< of the views [px]; the width is twice that
  double max_relative_error = 0.05;  ///< a hit counts as correct up to here
  int slack_px = 1;                  ///< see relative_error
  int max_keyframes = 60;            ///< views, evenly spread over the keyframes; 0 = all
  int threads = 0;                   ///< 0 = one for each CPU

  LabelOptions labels() const;
};

/// The cloud as one keyframe sees it.
struct View {
  std::int64_t keyframe_id = 0;
  double timestamp = 0.0;
  double hit = 0.0;  ///< share of all pixels that a point falls on: the completeness of Surmann et al. 2022
  double hit_solid_angle = 0.0;
  /// Only where the keyframe has a range map.
  struct Correct {
    double share = 0.0;  ///< of the pixels with a true range, those whose nearest point has the right range
    double share_solid_angle = 0.0;
    double of_hit = 0.0;        ///< the same, of the pixels that were hit
    double error_median = 0.0;  ///< relative, over pixels that were hit; NaN without any
  };
  std::optional<Correct> correct;
  LabelTable labels;  ///< empty without a range map
};

struct ViewMeasures {
  std::vector<View> views;
  std::vector<TrueView> truth;  ///< of the views' size, of those that have one
  int with_truth = 0;
  View mean;  ///< over all views; `correct` over those with truth, nullopt without any; `labels`: the sum
};

/// Range of the nearest point in each pixel of an equirectangular view, without any size of points; 0 = none.
Image<float> render_range(const std::vector<Eigen::Vector3f>& points, const RigidTransform& cam_from_world, int height);

/// Looks at each view: estimated range and relative error (NaN where unknown; empty without truth).
using ViewObserver = std::function<void(const View&, const Image<float>& range, const Image<float>& error)>;

/// `observe`, where set, is called from several threads, once for each view.
ViewMeasures measure_views(const AlignedCloud& cloud, const Alignment& alignment, const GroundTruth& truth,
                           const ViewOptions& options = {}, const ViewObserver& observe = {});

}  // namespace pmsp::eval
