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
  int height = 360;                  ///< of the views [px]; the width is twice as large
  double max_relative_error = 0.05;  ///< maximum error of a correct hit
  int slack_px = 1;                  ///< see relative_error
  int max_keyframes = 60;            ///< evenly spread; 0 = all
  int threads = 0;                   ///< 0 = one per CPU

  LabelOptions labels() const;
};

/// Cloud in the view of a keyframe.
struct View {
  std::int64_t keyframe_id = 0;
  double timestamp = 0.0;
  double hit = 0.0;  ///< share of pixels with a point: completeness of Surmann et al. 2022
  double hit_solid_angle = 0.0;
  /// Only for keyframes with a range map.
  struct Correct {
    double share = 0.0;  ///< of pixels with a true range: those whose nearest point has a correct range
    double share_solid_angle = 0.0;
    double of_hit = 0.0;        ///< as `share`, of hit pixels
    double error_median = 0.0;  ///< relative, over hit pixels; NaN without any
  };
  std::optional<Correct> correct;
  LabelTable labels;  ///< empty without a range map
};

struct ViewMeasures {
  std::vector<View> views;
  std::vector<TrueView> truth;  ///< in the size of the views, where available
  int with_truth = 0;
  View mean;  ///< over all views; `correct`: over those with truth, nullopt = none; `labels`: sum
};

/// Returns the range of the nearest point per pixel of an equirectangular view, for points without size; 0 = none.
Image<float> render_range(const std::vector<Eigen::Vector3f>& points, const RigidTransform& cam_from_world, int height);

/// Receives a view, its range and relative error (NaN = unknown; empty without truth).
using ViewObserver = std::function<void(const View&, const Image<float>& range, const Image<float>& error)>;

/// `observe`, if set, is called once per view, from several threads.
ViewMeasures measure_views(const AlignedCloud& cloud, const Alignment& alignment, const GroundTruth& truth,
                           const ViewOptions& options = {}, const ViewObserver& observe = {});

}  // namespace pmsp::eval
