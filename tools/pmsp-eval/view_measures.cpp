// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/view_measures.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "pmsp-eval/image_compare.h"
#include "pmsp-eval/parallel.h"
#include "pmsp-eval/statistics.h"

namespace pmsp::eval {
namespace {

constexpr double kMinRange = 1e-6;

void measure_hits(const Image<float>& range, View& view) {
  Share hits;
  for (int y = 0; y < range.height(); ++y) {
    const double weight = row_weight(y, range.height());
    for (int x = 0; x < range.width(); ++x) hits.add(range(x, y) > 0.0F, true, weight);
  }
  view.hit = hits.plain();
  view.hit_solid_angle = hits.weighted();
}

View::Correct measure_correct(const Image<float>& range, const Image<float>& error, double max_error) {
  Share correct;
  Share of_hit;
  std::vector<float> errors;
  for (int y = 0; y < range.height(); ++y) {
    const double weight = row_weight(y, range.height());
    for (int x = 0; x < range.width(); ++x) {
      if (std::isnan(error(x, y))) continue;
      const bool hit = range(x, y) > 0.0F;
      const bool good = hit && error(x, y) <= static_cast<float>(max_error);
      correct.add(good, true, weight);
      of_hit.add(good, hit, weight);
      if (hit) errors.push_back(error(x, y));
    }
  }
  return {correct.plain(), correct.weighted(), of_hit.plain(), percentile(errors, 50.0)};
}

View mean_view(const std::vector<View>& views) {
  View mean;
  std::vector<View::Correct> correct;
  for (const View& view : views) {
    mean.hit += view.hit / static_cast<double>(views.size());
    mean.hit_solid_angle += view.hit_solid_angle / static_cast<double>(views.size());
    mean.labels += view.labels;
    if (view.correct) correct.push_back(*view.correct);
  }
  if (correct.empty()) return mean;
  using Correct = View::Correct;
  Correct all;
  for (double Correct::*const field :
       {&Correct::share, &Correct::share_solid_angle, &Correct::of_hit, &Correct::error_median}) {
    all.*field = mean_without_nan(correct, [&](const Correct& of_view) { return of_view.*field; });
  }
  mean.correct = all;
  return mean;
}

}  // namespace

LabelOptions ViewOptions::labels() const {
  LabelOptions labels;
  labels.max_relative_error = max_relative_error;
  return labels;
}

Image<float> render_range(const std::vector<Eigen::Vector3f>& points, const RigidTransform& cam_from_world,
                          int height) {
  const int width = 2 * height;
  Image<float> range(width, height);
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d in_cam = cam_from_world * point.cast<double>();
    const double distance = in_cam.norm();
    if (!(distance > kMinRange)) continue;
    const Eigen::Vector2i pixel = pixel_of(in_cam, width, height);
    float& nearest = range(pixel.x(), pixel.y());
    if (nearest <= 0.0F || distance < nearest) nearest = static_cast<float>(distance);
  }
  return range;
}

ViewMeasures measure_views(const AlignedCloud& cloud, const Alignment& alignment, const GroundTruth& truth,
                           const ViewOptions& options, const ViewObserver& observe) {
  const auto chosen = spread_indices(cloud.keyframes.size(), static_cast<std::size_t>(options.max_keyframes));
  ViewMeasures result;
  result.views.resize(chosen.size());
  std::vector<TrueView> truth_of_views(chosen.size());
  parallel_chunks(chosen.size(), 1, options.threads, [&](std::size_t i, std::size_t) {
    const TimedPose& keyframe = cloud.keyframes[chosen[i]];
    View& view = result.views[i];
    view.keyframe_id = keyframe.id;
    view.timestamp = keyframe.timestamp;
    const RigidTransform cam_from_world = keyframe.world_from_cam.inverse();
    const Image<float> range = render_range(cloud.points, cam_from_world, options.height);
    measure_hits(range, view);
    Image<float> error;
    const int row = alignment.truth_row[chosen[i]];
    if (const GroundTruth::RangeMap* map = row >= 0 ? truth.find(row) : nullptr) {
      const Image<float> true_range = GroundTruth::load(*map);
      error = relative_error(range, true_range, options.slack_px);
      view.correct = measure_correct(range, error, options.max_relative_error);
      const Image<std::uint8_t> labels = GroundTruth::load_labels(*map);
      truth_of_views[i] = {cam_from_world, resampled(true_range, range.width(), range.height()),
                           labels.empty() ? labels : resampled(labels, range.width(), range.height())};
      view.labels = measure_labels(range, error, truth_of_views[i].range, truth_of_views[i].labels, options.labels());
    }
    if (observe) observe(view, range, error);
  });
  result.with_truth = static_cast<int>(
      std::count_if(result.views.begin(), result.views.end(), [](const View& v) { return v.correct.has_value(); }));
  std::copy_if(std::make_move_iterator(truth_of_views.begin()), std::make_move_iterator(truth_of_views.end()),
               std::back_inserter(result.truth), [](const TrueView& view) { return !view.range.empty(); });
  result.mean = mean_view(result.views);
  return result;
}

}  // namespace pmsp::eval
