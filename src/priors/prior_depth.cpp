// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "pmsp/stages.h"
#include "priors/nearest_value.h"
#include "util/median_of.h"
#include "util/percent.h"

namespace pmsp {
namespace {

constexpr double kAgrees = 0.15;  ///< maximum relative error of a depth that agrees
constexpr std::size_t kMinLandmarks = 12;
constexpr double kMinFitShare = 0.6;
constexpr double kBetterThanFlat = 0.6;  ///< maximum sum of errors, over that of a constant depth
constexpr double kHardlyWorse = 1.1;
constexpr std::size_t kMostFitLandmarks = 400;
constexpr int kPairs = 200;
constexpr int kRefinements = 5;

struct Pair {
  double value;
  double depth;
};

/// Scale and shift relate x(v) to t(depth).
double x_of(DepthModel model, double value) { return model == DepthModel::kWarped ? 1.0 / value : value; }
bool is_of_depth(DepthModel model) { return model == DepthModel::kScaled || model == DepthModel::kDepth; }

/// Depth of value v; 0 = none.
double depth_of(DepthModel model, double scale, double shift, double value) {
  if (model == DepthModel::kWarped && !(value > 0.0)) return 0.0;
  const double t = scale * x_of(model, value) + shift;
  const double depth = is_of_depth(model) ? t : 1.0 / t;
  return t > 0.0 && is_usable_depth(depth) ? depth : 0.0;
}

double error_of(const DepthAlignment& fit, const Pair& pair) {
  const double depth = depth_of(fit.model, fit.scale, fit.shift, pair.value);
  return depth > 0.0 ? std::min(std::abs(depth / pair.depth - 1.0), kAgrees) : kAgrees;
}

double sum_of_errors(const DepthAlignment& fit, const std::vector<Pair>& pairs) {
  double sum = 0.0;
  for (const Pair& pair : pairs) sum += error_of(fit, pair);
  return sum;
}

/// Keeps the fit with the smaller sum of errors.
void consider(DepthAlignment& best, double& least, const DepthAlignment& fit, const std::vector<Pair>& pairs) {
  if (!(fit.scale > 0.0) || !std::isfinite(fit.scale) || !std::isfinite(fit.shift)) return;
  const double sum = sum_of_errors(fit, pairs);
  if (!(sum < least)) return;
  least = sum;
  best = fit;
}

/// Least squares of relative errors, over the pairs that agree with `fit`.
DepthAlignment refined(const DepthAlignment& fit, const std::vector<Pair>& pairs) {
  double xx = 0.0, x1 = 0.0, ones = 0.0, xt = 0.0, t1 = 0.0;
  for (const Pair& pair : pairs) {
    if (error_of(fit, pair) >= kAgrees) continue;
    const double x = x_of(fit.model, pair.value);
    const double t = is_of_depth(fit.model) ? pair.depth : 1.0 / pair.depth;
    const double w = 1.0 / (t * t);
    xx += w * x * x;
    x1 += w * x;
    ones += w;
    xt += w * x * t;
    t1 += w * t;
  }
  DepthAlignment better = fit;
  if (fit.model == DepthModel::kScaled) {
    if (xx > 0.0) better.scale = xt / xx;
    return better;
  }
  const double determinant = xx * ones - x1 * x1;
  if (!(determinant > 1e-12 * xx * ones)) return fit;
  better.scale = (xt * ones - t1 * x1) / determinant;
  better.shift = (t1 * xx - xt * x1) / determinant;
  return better;
}

/// Best fit of one model; scale 0 = none.
DepthAlignment best_of(DepthModel model, const std::vector<Pair>& all, double& least) {
  std::vector<Pair> pairs;
  for (const Pair& pair : all) {
    if (model != DepthModel::kWarped || pair.value > 0.0) pairs.push_back(pair);
  }
  DepthAlignment best;
  best.model = model;
  least = std::numeric_limits<double>::infinity();
  if (pairs.size() < kMinLandmarks) return best;
  std::uint64_t state = 1;
  const auto draw = [&] {  // Knuth's MMIX generator
    state = state * 6364136223846793005U + 1442695040888963407U;
    return static_cast<std::size_t>((state >> 33U) % pairs.size());
  };
  for (int i = 0; i < kPairs; ++i) {
    const Pair& a = pairs[draw()];
    const Pair& b = pairs[draw()];
    DepthAlignment fit = best;
    if (model == DepthModel::kScaled) {
      fit.scale = a.depth / a.value;
    } else {
      const double xa = x_of(model, a.value), xb = x_of(model, b.value);
      if (xa == xb) continue;
      const double ta = is_of_depth(model) ? a.depth : 1.0 / a.depth;
      const double tb = is_of_depth(model) ? b.depth : 1.0 / b.depth;
      fit.scale = (ta - tb) / (xa - xb);
      fit.shift = ta - fit.scale * xa;
    }
    consider(best, least, fit, all);
  }
  for (int i = 0; i < kRefinements && best.scale > 0.0; ++i) consider(best, least, refined(best, all), all);
  return best;
}

double error_of_flat(const std::vector<Pair>& pairs) {
  std::vector<double> depths;
  for (const Pair& pair : pairs) depths.push_back(pair.depth);
  const double depth = median(depths);
  double sum = 0.0;
  for (const Pair& pair : pairs) sum += std::min(std::abs(depth / pair.depth - 1.0), kAgrees);
  return sum;
}

std::vector<Pair> pairs_of(ImageView<const float> values, const Keyframe& keyframe) {
  std::vector<Pair> pairs;
  for (const Landmark& landmark : keyframe.landmarks) {
    const Eigen::Vector3d p = keyframe.cam_from_world * landmark.position_world;
    if (!is_usable_depth(p.norm())) continue;
    const double value = nearest_value(values, p);
    if (std::isfinite(value) && value != 0.0) pairs.push_back({value, p.norm()});
  }
  if (pairs.size() <= kMostFitLandmarks) return pairs;
  std::vector<Pair> some;
  for (std::size_t i = 0; i < kMostFitLandmarks; ++i) some.push_back(pairs[i * pairs.size() / kMostFitLandmarks]);
  return some;
}

}  // namespace

const char* name_of(DepthModel model) {
  switch (model) {
    case DepthModel::kScaled:
      return "depth";
    case DepthModel::kDepth:
      return "depth and a shift";
    case DepthModel::kInverse:
      return "inverse depth";
    case DepthModel::kWarped:
      return "depth of shifted inverse depth";
  }
  return "";
}

DepthAlignment align_prior_depth(ImageView<const float> values, const Keyframe& keyframe) {
  const std::vector<Pair> pairs = pairs_of(values, keyframe);
  DepthAlignment best;
  best.landmarks = pairs.size();
  if (pairs.size() < kMinLandmarks) {
    best.why_not = std::to_string(pairs.size()) + " landmarks have a value in it; expected " +
                   std::to_string(kMinLandmarks) + " or more";
    return best;
  }
  double least = 0.0;
  best = best_of(DepthModel::kScaled, pairs, least);
  least *= 1.0 / kHardlyWorse;
  for (const DepthModel model : {DepthModel::kDepth, DepthModel::kInverse, DepthModel::kWarped}) {
    double sum = 0.0;
    const DepthAlignment fit = best_of(model, pairs, sum);
    if (!(sum < least)) continue;
    least = sum;
    best = fit;
  }
  best.landmarks = pairs.size();
  std::vector<double> errors;
  for (const Pair& pair : pairs) {
    const double error = error_of(best, pair);
    if (error < kAgrees) errors.push_back(error);
  }
  best.share = static_cast<double>(errors.size()) / static_cast<double>(pairs.size());
  if (!errors.empty()) best.error = median(errors);
  if (!(best.scale > 0.0) || best.share < kMinFitShare) {
    best.why_not = "it agrees with " + percent(best.share) + " of " + std::to_string(pairs.size()) +
                   " landmarks to 15 %; expected " + percent(kMinFitShare) + " or more";
  } else if (sum_of_errors(best, pairs) > kBetterThanFlat * error_of_flat(pairs)) {
    best.why_not = "it fits the landmarks hardly better than a constant depth";
  }
  return best;
}

double depth_ratio(ImageView<const float> depth, const Keyframe& keyframe) {
  std::vector<double> ratios;
  for (const Pair& pair : pairs_of(depth, keyframe)) ratios.push_back(pair.value / pair.depth);
  return ratios.size() < kMinLandmarks ? 0.0 : median(ratios);
}

Image<float> aligned_depth(ImageView<const float> values, const DepthAlignment& alignment) {
  Image<float> depth(values.width, values.height);
  for (int y = 0; y < values.height; ++y) {
    const float* const from = values.row(y);
    float* const to = depth.row(y);
    for (int x = 0; x < values.width; ++x) {
      const double value = static_cast<double>(from[x]);
      if (!std::isfinite(value) || value == 0.0) continue;
      to[x] = static_cast<float>(depth_of(alignment.model, alignment.scale, alignment.shift, value));
    }
  }
  return depth;
}

}  // namespace pmsp
