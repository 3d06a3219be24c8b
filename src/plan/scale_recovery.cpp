// SPDX-License-Identifier: BSD-2-Clause
#include "plan/scale_recovery.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace pmsp {
namespace {

/// Logarithm of a ratio of lengths, after over before.
struct Ratio {
  double log;
  double weight;
};

/// Estimated change of a keyframe's scale.
struct Estimate {
  double log;
  double error;  ///< standard deviation of `log`
};

constexpr std::size_t kFewestBaselines = 3;
constexpr std::size_t kFewestLandmarks = 12;
/// Lower bound of the error, however many ratios agree: poses of a neighbourhood have correlated errors.
constexpr double kLeastError = 1e-3;
/// Difference beyond which estimates contradict each other [standard errors].
constexpr double kContradiction = 3.0;
/// Change up to which a scale is kept [standard errors].
constexpr double kSignificant = 3.0;
/// Change up to which it is kept in any case: bundle adjustments move neighbours together.
constexpr double kLeastChange = 5e-3;
/// Ratio of standard deviation to median absolute deviation, for a normal distribution.
constexpr double kDeviationOverMedian = 1.4826;
/// Ratio of the standard errors of median and mean.
constexpr double kMedianOverMean = 1.2533;

/// Calls `look(k)` for the keyframes around index i of `count`.
template <class Look>
void for_each_around(std::size_t count, std::size_t i, const Look& look) {
  const std::size_t end = std::min(count, i + kScaleReach + 1);
  for (std::size_t k = i > kScaleReach ? i - kScaleReach : 0; k < end; ++k) {
    if (k != i) look(k);
  }
}

/// Median of ratios of equal weight, without sorting.
double plain_median(std::vector<Ratio>& ratios) {
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>((ratios.size() - 1) / 2);
  std::nth_element(ratios.begin(), middle, ratios.end(), [](const Ratio& a, const Ratio& b) { return a.log < b.log; });
  return middle->log;
}

double weighted_median(std::vector<Ratio>& ratios) {
  const double weight = ratios.front().weight;
  if (std::all_of(ratios.begin(), ratios.end(), [&](const Ratio& ratio) { return ratio.weight == weight; })) {
    return plain_median(ratios);
  }
  std::sort(ratios.begin(), ratios.end(), [](const Ratio& a, const Ratio& b) { return a.log < b.log; });
  double half = 0.0;
  for (const Ratio& ratio : ratios) half += 0.5 * ratio.weight;
  for (const Ratio& ratio : ratios) {
    half -= ratio.weight;
    if (half <= 0.0) return ratio.log;
  }
  return ratios.back().log;
}

std::optional<Estimate> robust_mean(std::vector<Ratio> ratios, std::size_t fewest) {
  if (ratios.size() < fewest) return std::nullopt;
  const double middle = weighted_median(ratios);
  double sum = 0.0;
  double squares = 0.0;
  for (const Ratio& ratio : ratios) {
    sum += ratio.weight;
    squares += ratio.weight * ratio.weight;
  }
  std::vector<Ratio> deviations;
  deviations.reserve(ratios.size());
  for (const Ratio& ratio : ratios) deviations.push_back({std::abs(ratio.log - middle), ratio.weight});
  const double deviation = kDeviationOverMedian * weighted_median(deviations);
  const double effective_count = sum * sum / squares;  // of ratios
  return Estimate{middle, kLeastError + kMedianOverMean * deviation / std::sqrt(effective_count)};
}

/// Returns the slope of ratios over their places: the weighted median of the slopes of all pairs.
double robust_slope(const std::vector<Ratio>& ratios, const std::vector<double>& places) {
  std::vector<Ratio> slopes;
  for (std::size_t a = 0; a < ratios.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const double apart = places[a] - places[b];
      slopes.push_back({(ratios[a].log - ratios[b].log) / apart, ratios[a].weight * ratios[b].weight * apart * apart});
    }
  }
  return slopes.empty() ? 0.0 : weighted_median(slopes);
}

/// Returns the mean at place 0 of ratios that drift along the sequence.
std::optional<Estimate> robust_mean_along(std::vector<Ratio> ratios, const std::vector<double>& places,
                                          std::size_t fewest) {
  if (ratios.size() < fewest) return std::nullopt;
  const double drift = robust_slope(ratios, places);
  double leverage = 0.0;  // distance of place 0 from the mean place, relative to the spread
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t k = 0; k < ratios.size(); ++k) {
    leverage += ratios[k].weight * places[k];
    squares += ratios[k].weight * places[k] * places[k];
    sum += ratios[k].weight;
    ratios[k].log -= drift * places[k];
  }
  leverage /= std::sqrt(std::max(sum * squares - leverage * leverage, 1e-12 * sum * sum));
  std::optional<Estimate> estimate = robust_mean(std::move(ratios), fewest);
  if (estimate) estimate->error *= std::sqrt(1.0 + leverage * leverage);
  return estimate;
}

/// Longer baselines have less relative noise. If the scale drifts along the sequence, the ratio of a baseline is that
/// of its middle; it is extrapolated along the drift to the keyframe, which is not in the middle of its baselines at
/// ends and turns of the trajectory.
std::optional<Estimate> from_baselines(const std::vector<MovedKeyframe>& keyframes, std::size_t i) {
  const Eigen::Vector3d before = keyframes[i].before.cam_from_world.center();
  const Eigen::Vector3d after = keyframes[i].after.center();
  std::vector<Ratio> ratios;
  std::vector<double> places;
  for_each_around(keyframes.size(), i, [&](std::size_t k) {
    if (keyframes[k].map_before != keyframes[i].map_before) return;
    const double length = (keyframes[k].before.cam_from_world.center() - before).norm();
    const double now = (keyframes[k].after.center() - after).norm();
    if (!(length > 0.0) || !(now > 0.0)) return;
    ratios.push_back({std::log(now / length), length * length});
    places.push_back(static_cast<double>(k) - static_cast<double>(i));
  });
  return robust_mean_along(std::move(ratios), places, kFewestBaselines);
}
std::optional<Estimate> from_landmarks(const MovedKeyframe& keyframe) {
  std::vector<Ratio> ratios;
  const std::size_t count = std::min(keyframe.ranges_before.size(), keyframe.ranges_after.size());
  for (std::size_t k = 0; k < count; ++k) {
    const double length = keyframe.ranges_before[k];
    const double now = keyframe.ranges_after[k];
    if (length > 0.0 && now > 0.0) ratios.push_back({std::log(now / length), 1.0});
  }
  return robust_mean(std::move(ratios), kFewestLandmarks);
}

bool contradict(const Estimate& a, const Estimate& b) {
  return std::abs(a.log - b.log) > kContradiction * std::hypot(a.error, b.error);
}

Estimate mean(const Estimate& a, const Estimate& b) {
  const double weight_a = 1.0 / (a.error * a.error);
  const double weight_b = 1.0 / (b.error * b.error);
  return {(weight_a * a.log + weight_b * b.log) / (weight_a + weight_b), 1.0 / std::sqrt(weight_a + weight_b)};
}

/// Independent estimates for a keyframe.
struct Evidence {
  std::optional<Estimate> baselines, landmarks;

  /// Returns their combination; nullopt if they contradict each other.
  std::optional<Estimate> agreed() const {
    if (!baselines) return landmarks;
    if (!landmarks) return baselines;
    if (contradict(*baselines, *landmarks)) return std::nullopt;
    return mean(*baselines, *landmarks);
  }
};

/// Returns the estimate of surrounding keyframes; nullopt without any.
std::optional<Estimate> around(const std::vector<Evidence>& evidence, std::size_t i) {
  std::vector<Ratio> logs;
  std::vector<double> places;
  for_each_around(evidence.size(), i, [&](std::size_t k) {
    const std::optional<Estimate> agreed = evidence[k].agreed();
    if (!agreed) return;
    logs.push_back({agreed->log, 1.0 / (agreed->error * agreed->error)});
    places.push_back(static_cast<double>(k) - static_cast<double>(i));
  });
  return robust_mean_along(std::move(logs), places, 1);
}

std::optional<Estimate> decide(const std::vector<Evidence>& evidence, std::size_t i) {
  const std::optional<Estimate> agreed = evidence[i].agreed();
  if (agreed) return agreed;
  const std::optional<Estimate> others = around(evidence, i);
  if (!evidence[i].baselines) return others;  // no estimate of its own
  if (!others) return evidence[i].baselines;
  const double of_baselines = std::abs(evidence[i].baselines->log - others->log);
  const double of_landmarks = std::abs(evidence[i].landmarks->log - others->log);
  return of_landmarks < of_baselines ? evidence[i].landmarks : evidence[i].baselines;
}

}  // namespace

std::vector<double> recover_scales(const std::vector<MovedKeyframe>& keyframes) {
  std::vector<Evidence> evidence(keyframes.size());
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    evidence[i] = {from_baselines(keyframes, i), from_landmarks(keyframes[i])};
  }
  std::vector<double> scales;
  scales.reserve(keyframes.size());
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const std::optional<Estimate> change = decide(evidence, i);
    const bool significant = change && std::abs(change->log) > std::max(kLeastChange, kSignificant * change->error);
    const double scale = keyframes[i].before.scale * (significant ? std::exp(change->log) : 1.0);
    scales.push_back(std::clamp(scale, 1.0 / kMaxScale, kMaxScale));
  }
  return scales;
}

}  // namespace pmsp
