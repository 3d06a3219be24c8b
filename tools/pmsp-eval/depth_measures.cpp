// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/depth_measures.h"

#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "elementary.h"
#include "pmsp-eval/ground_truth.h"
#include "pmsp-eval/image_compare.h"
#include "pmsp-eval/statistics.h"

namespace pmsp::eval {
namespace {

Image<float> in_metres(const Image<float>& depth, double scale) {
  Image<float> metres = depth;
  for (float& value : metres.pixels()) {
    value = std::isfinite(value) && value > 0.0F ? static_cast<float>(value * scale) : 0.0F;
  }
  return metres;
}

double mean_without_nan(const std::vector<DepthMeasures>& maps, double DepthMeasures::*field) {
  return mean_without_nan(maps, [field](const DepthMeasures& map) { return map.*field; });
}

DepthFigures mean_figures(const std::vector<DepthMeasures>& maps, DepthFigures DepthMeasures::*which) {
  DepthFigures mean;
  for (const DepthFigure& figure : kDepthFigures) {
    mean.*figure.value = mean_without_nan(maps, [&](const DepthMeasures& map) { return (map.*which).*figure.value; });
  }
  return mean;
}

}  // namespace

DepthMeasures measure_depth(const Image<float>& depth, const Image<float>& truth, const DepthMeasureOptions& options,
                            Image<float>* error) {
  const Image<float> metres = in_metres(depth, options.scale);
  const Image<float> ranges = true_ranges(metres, truth, options.slack_px);
  Image<float> relative(depth.width(), depth.height(), std::numeric_limits<float>::quiet_NaN());
  DepthFigureSums plain, solid_angle;
  Share valid;
  std::vector<Share> within(options.relative.size());
  std::vector<Share> of_valid(options.relative.size());
  std::vector<float> errors;
  for (int y = 0; y < depth.height(); ++y) {
    const double weight = row_weight(y, depth.height());
    for (int x = 0; x < depth.width(); ++x) {
      const float estimate = metres(x, y), range = ranges(x, y);
      if (std::isnan(range)) continue;
      const float e = std::abs(estimate - range) / range;
      const bool known = estimate > 0.0F;
      valid.add(known, true, weight);
      for (std::size_t t = 0; t < options.relative.size(); ++t) {
        const bool good = known && e < static_cast<float>(options.relative[t]);
        within[t].add(good, true, weight);
        of_valid[t].add(good, known, weight);
      }
      if (!known) continue;
      errors.push_back(e);
      relative(x, y) = e;
      plain.add_range(static_cast<double>(estimate), static_cast<double>(range), 1.0);
      solid_angle.add_range(static_cast<double>(estimate), static_cast<double>(range), weight);
    }
  }
  DepthMeasures result;
  result.valid = valid.plain();
  result.valid_solid_angle = valid.weighted();
  for (std::size_t t = 0; t < options.relative.size(); ++t) {
    result.within.push_back({options.relative[t], within[t].plain(), within[t].weighted(), of_valid[t].plain()});
  }
  result.error_median = percentile(errors, 50.0);
  result.error_p90 = percentile(errors, 90.0);
  result.plain = plain.result();
  result.solid_angle = solid_angle.result();
  if (error != nullptr) *error = std::move(relative);
  return result;
}

void measure_normals(const Image<Eigen::Vector3f>& normals, const Image<Eigen::Vector3f>& truth,
                     DepthMeasures& measures) {
  const auto is_normal = [](const Eigen::Vector3f& n) { return n.allFinite() && n.squaredNorm() > 0.25F; };
  DepthFigureSums plain, solid_angle;
  for (int y = 0; y < normals.height(); ++y) {
    const double weight = row_weight(y, normals.height());
    const Eigen::Vector3f* const there = truth.row(centre_index(y, normals.height(), truth.height()));
    for (int x = 0; x < normals.width(); ++x) {
      const Eigen::Vector3f& a = normals(x, y);
      const Eigen::Vector3f& b = there[centre_index(x, normals.width(), truth.width())];
      if (!is_normal(a) || !is_normal(b)) continue;
      const float angle = std::atan2(a.cross(b).norm(), a.dot(b)) * static_cast<float>(180.0 / kernels::kPi);
      plain.add_normal(angle, 1.0);
      solid_angle.add_normal(angle, weight);
    }
  }
  for (const auto& [sums, figures] :
       {std::pair{&plain, &measures.plain}, std::pair{&solid_angle, &measures.solid_angle}}) {
    const DepthFigures result = sums->result();
    for (std::size_t i = kRangeFigures; i < kDepthFigures.size(); ++i) {
      double DepthFigures::*const value = kDepthFigures[i].value;
      figures->*value = result.*value;
    }
  }
}

std::optional<double> own_scale(const Image<float>& depth, const Image<float>& truth) {
  const Image<float> there = resampled(truth, depth.width(), depth.height());
  std::vector<float> ratios;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const float estimate = depth.pixels()[i];
    const float range = there.pixels()[i];
    if (std::isfinite(estimate) && estimate > 0.0F && is_range(range)) ratios.push_back(range / estimate);
  }
  if (ratios.empty()) return std::nullopt;
  return percentile(ratios, 50.0);
}

DepthMeasures mean_of(const std::vector<DepthMeasures>& maps) {
  DepthMeasures mean;
  mean.valid = mean_without_nan(maps, &DepthMeasures::valid);
  mean.valid_solid_angle = mean_without_nan(maps, &DepthMeasures::valid_solid_angle);
  mean.error_median = mean_without_nan(maps, &DepthMeasures::error_median);
  mean.error_p90 = mean_without_nan(maps, &DepthMeasures::error_p90);
  mean.plain = mean_figures(maps, &DepthMeasures::plain);
  mean.solid_angle = mean_figures(maps, &DepthMeasures::solid_angle);
  mean.within = maps.front().within;
  for (std::size_t t = 0; t < mean.within.size(); ++t) {
    using Within = DepthMeasures::Within;
    for (double Within::*const field : {&Within::share, &Within::share_solid_angle, &Within::of_valid}) {
      mean.within[t].*field = mean_without_nan(maps, [&](const DepthMeasures& map) { return map.within[t].*field; });
    }
  }
  return mean;
}

}  // namespace pmsp::eval
