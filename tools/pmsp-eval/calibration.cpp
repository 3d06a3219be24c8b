// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/calibration.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "pmsp-eval/image_compare.h"

namespace pmsp::eval {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Weighted sample.
struct Weighted {
  float confidence;
  float error;
  float weight;
};

/// Weighted quantile: smallest value not exceeded by at least `share` of the weight. `samples`: ascending, not empty.
double quantile(const std::vector<Weighted>& samples, float Weighted::*value, double total, double share) {
  double sum = 0.0;
  for (const Weighted& sample : samples) {
    sum += static_cast<double>(sample.weight);
    if (sum >= share * total) return static_cast<double>(sample.*value);
  }
  return static_cast<double>(samples.back().*value);
}

/// Expected relative error of a confidence (median, see pmsp::DepthMap).
double expected_error(double confidence) { return 0.005 * (1.0 / confidence - 1.0); }

/// Accumulates a bin, in ascending confidence.
class BinBuilder {
 public:
  void add(const ConfidenceSample& sample, float weight) {
    if (samples_.empty()) bin_.confidence_min = static_cast<double>(sample.confidence);
    bin_.confidence_max = static_cast<double>(sample.confidence);
    samples_.push_back({sample.confidence, sample.error, weight});
  }

  CalibrationBin finish(double total, double threshold) {
    if (samples_.empty()) return {0.0, kNan, kNan, kNan, kNan, kNan, kNan};
    double sum = 0.0;
    double within = 0.0;
    for (const Weighted& sample : samples_) {
      sum += static_cast<double>(sample.weight);
      if (static_cast<double>(sample.error) < threshold) within += static_cast<double>(sample.weight);
    }
    bin_.share = sum / total;
    bin_.expected_error = expected_error(quantile(samples_, &Weighted::confidence, sum, 0.5));
    std::sort(samples_.begin(), samples_.end(), [](const auto& a, const auto& b) { return a.error < b.error; });
    bin_.error_median = quantile(samples_, &Weighted::error, sum, 0.5);
    bin_.error_p90 = quantile(samples_, &Weighted::error, sum, 0.9);
    bin_.within = within / sum;
    return bin_;
  }

 private:
  CalibrationBin bin_;
  std::vector<Weighted> samples_;
};

/// Updates monotonicity and relative rise between adjacent bins.
void compare(const CalibrationBin& lower, const CalibrationBin& higher, Monotone& monotone) {
  const auto rise = [&](double CalibrationBin::*error) {
    if (higher.*error <= lower.*error) return 0.0;
    return lower.*error > 0.0 ? higher.*error / (lower.*error) - 1.0 : std::numeric_limits<double>::infinity();
  };
  const double median = rise(&CalibrationBin::error_median);
  const double p90 = rise(&CalibrationBin::error_p90);
  monotone.median = monotone.median && median == 0.0;
  monotone.p90 = monotone.p90 && p90 == 0.0;
  monotone.within = monotone.within && higher.within >= lower.within;
  monotone.largest_rise = std::max({monotone.largest_rise, median, p90});
}

Monotone judge(const std::array<CalibrationBin, 10>& deciles) {
  std::vector<CalibrationBin> filled;
  std::copy_if(deciles.begin(), deciles.end(), std::back_inserter(filled),
               [](const auto& bin) { return bin.share > 0.0; });
  if (filled.size() < 2) return {};
  Monotone monotone{true, true, true, 0.0};
  for (std::size_t i = 1; i < filled.size(); ++i) compare(filled[i - 1], filled[i], monotone);
  return monotone;
}

/// `samples`: ascending by confidence.
CalibrationCurve curve(const std::vector<ConfidenceSample>& samples, bool by_solid_angle, double threshold) {
  const auto weight_of = [by_solid_angle](const ConfidenceSample& sample) {
    return by_solid_angle ? sample.weight : 1.0F;
  };
  double total = 0.0;
  for (const ConfidenceSample& sample : samples) total += static_cast<double>(weight_of(sample));
  std::array<BinBuilder, 10> deciles;
  BinBuilder half;
  double before = 0.0;
  for (std::size_t first = 0; first < samples.size();) {
    std::size_t last = first;
    double group = 0.0;
    for (; last < samples.size() && samples[last].confidence == samples[first].confidence; ++last) {
      group += static_cast<double>(weight_of(samples[last]));
    }
    const double middle = (before + 0.5 * group) / total;
    const auto decile = std::min<std::size_t>(9, static_cast<std::size_t>(10.0 * middle));
    for (; first < last; ++first) {
      deciles[decile].add(samples[first], weight_of(samples[first]));
      if (decile >= 5) half.add(samples[first], weight_of(samples[first]));
    }
    before += group;
  }
  CalibrationCurve result;
  for (std::size_t i = 0; i < deciles.size(); ++i) result.deciles[i] = deciles[i].finish(total, threshold);
  result.confident_half = half.finish(total, threshold);
  result.monotone = judge(result.deciles);
  return result;
}

}  // namespace

std::vector<ConfidenceSample> calibration_samples(const Image<float>& error, const Image<float>& confidence,
                                                  std::size_t stride) {
  std::vector<ConfidenceSample> samples;
  const auto width = static_cast<std::size_t>(error.width());
  for (std::size_t i = 0; i < error.size(); i += stride) {
    const float e = error.pixels()[i];
    const float c = confidence.pixels()[i];
    if (std::isnan(e) || std::isnan(c)) continue;
    samples.push_back({c, e, static_cast<float>(row_weight(static_cast<int>(i / width), error.height()))});
  }
  return samples;
}

Calibration calibrate(std::vector<ConfidenceSample>& samples) {
  std::sort(samples.begin(), samples.end(),
            [](const ConfidenceSample& a, const ConfidenceSample& b) { return a.confidence < b.confidence; });
  Calibration result;
  result.pixels = samples.size();
  result.plain = curve(samples, false, result.threshold);
  result.solid_angle = curve(samples, true, result.threshold);
  return result;
}

}  // namespace pmsp::eval
