// SPDX-License-Identifier: BSD-2-Clause
#include "pairing_trial.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <unordered_set>
#include <utility>

#include "image_naming.h"
#include "util/median_of.h"

namespace pmsp::io {
namespace {

constexpr std::size_t kTrialLandmarks = 300;  ///< per image
constexpr std::size_t kScanLandmarks = 100;   ///< per image, in a search over many anchors
constexpr int kComparisons = 30;              ///< minimum for a verdict
constexpr double kPoorFit = 0.25;             ///< minimum fit of poor images
constexpr std::size_t kRun = 4;               ///< keyframes per run
constexpr std::size_t kFirst = 12;            ///< keyframes at the beginning among which a run may start
constexpr std::size_t kCommon = 60;           ///< common landmarks beyond which a pair is no better
constexpr double kParallax = 0.2;             ///< ratio of baseline and distance beyond which a pair is no better
constexpr double kHopeless = 0.2;             ///< fit of two images below which the others of a run are skipped
constexpr double kFoundFit = 0.5;             ///< above the best of many wrong anchors
constexpr int kBehindPeak = 8;                ///< frames without a better anchor before the best one is verified
constexpr double kPlateau = 0.15;             ///< fit below that of the best anchor, for verification
constexpr std::int64_t kBeside = 3;           ///< frames around the best anchor that are also verified
constexpr std::size_t kPeaks = 4;             ///< maximum number verified after all anchors were tried
constexpr double kAlike = 0.1;                ///< difference in fit of equally good anchors

Evidence evidence_of(const PairingSeries& series) {
  return {series.found().tries(), series.fit(), series.least_fit(), series.likeness(), series.fit_deviation()};
}

/// Ratio of baseline and median distance of the common landmarks, weighted by their number.
double value_of_pair(const SlamMap& map, const MapKeyframe& a, const MapKeyframe& b) {
  std::unordered_set<std::int64_t> seen;
  for (const MapObservation& observation : a.observations) seen.insert(observation.landmark_id);
  const Eigen::Vector3d centre = a.cam_from_world.center();
  std::vector<double> distances;
  for (const MapObservation& observation : b.observations) {
    if (seen.count(observation.landmark_id) == 0) continue;
    const MapLandmark* landmark = map.find_landmark(observation.landmark_id);
    if (landmark != nullptr) distances.push_back((landmark->position_world - centre).norm());
  }
  if (distances.empty()) return 0.0;
  const double common = static_cast<double>(std::min(distances.size(), kCommon)) / kCommon;
  const double parallax = (b.cam_from_world.center() - centre).norm() / std::max(median(distances), 1e-12);
  return std::isfinite(parallax) ? common * std::min(parallax, kParallax) : 0.0;
}

class AnchorSearch {
 public:
  AnchorSearch(const SlamMap& map, const Keyframes& run, const Keyframes& more, const FrameReading& reading)
      : map_(map), run_(run), all_(run), reading_(reading) {
    for (const MapKeyframe* keyframe : more)
      if (std::find(all_.begin(), all_.end(), keyframe) == all_.end()) all_.push_back(keyframe);
  }

  std::optional<FoundAnchor> find(std::int64_t first, std::int64_t last) {
    Tried peak;  // fit 0 = none
    for (std::int64_t anchor = first; anchor <= last; ++anchor) {
      if (reading_.image(anchor) == nullptr) continue;
      tried_.push_back({anchor, try_run(anchor)});
      const Tried& now = tried_.back();
      if (now.fit >= kExpectedFit && now.fit > peak.fit) peak = now;
      if (peak.fit == 0.0 || anchor < peak.anchor + kBehindPeak) continue;
      const std::optional<FoundAnchor> found = verify(peak);
      if (found) return found;
      peak = {};
    }
    return best_of_all();
  }

 private:
  struct Tried {
    std::int64_t anchor = 0;
    double fit = 0.0;
  };

  const Image<Rgb>* image_of(const MapKeyframe& keyframe, std::int64_t anchor) const {
    const std::optional<std::int64_t> frame = reading_.frame_of(keyframe, anchor);
    return frame && *frame >= 0 ? reading_.image(*frame) : nullptr;
  }

  double try_run(std::int64_t anchor) const {
    PairingSeries series(map_, kScanLandmarks);
    for (const MapKeyframe* keyframe : run_) {
      const Image<Rgb>* image = image_of(*keyframe, anchor);
      if (image == nullptr) continue;
      series.add(*keyframe, image->view());
      if (series.found().tries() >= kComparisons && series.fit() < kHopeless) break;
    }
    return series.found().tries() >= kComparisons ? series.fit() : 0.0;
  }

  /// Best anchor over all keyframes, among the peak and nearby ones with a similar fit.
  std::optional<FoundAnchor> verify(const Tried& peak) const {
    std::int64_t from = peak.anchor - kBeside;
    std::int64_t to = peak.anchor + kBeside;
    for (const Tried& tried : tried_) {
      if (tried.fit < peak.fit - kPlateau || std::abs(tried.anchor - peak.anchor) > kBeside * kBehindPeak) continue;
      from = std::min(from, tried.anchor);
      to = std::max(to, tried.anchor);
    }
    std::optional<FoundAnchor> best;
    for (std::int64_t anchor = std::max<std::int64_t>(from, 0); anchor <= to; ++anchor) {
      const Evidence evidence = try_images(map_, all_, [&](const MapKeyframe& k) { return image_of(k, anchor); });
      if (!evidence.fits() || evidence.fit < kFoundFit) continue;
      if (!best || evidence.fit > best->evidence.fit) best = FoundAnchor{anchor, evidence};
    }
    return best;
  }

  std::optional<FoundAnchor> best_of_all() const {
    std::vector<Tried> peaks = tried_;
    std::stable_sort(peaks.begin(), peaks.end(), [](const Tried& a, const Tried& b) { return a.fit > b.fit; });
    std::vector<FoundAnchor> found;
    std::vector<std::int64_t> known;
    for (const Tried& peak : peaks) {
      if (peak.fit < kHopeless || known.size() == kPeaks) break;
      const bool is_beside = std::any_of(
          known.begin(), known.end(), [&](std::int64_t anchor) { return std::abs(anchor - peak.anchor) <= kBeside; });
      if (is_beside) continue;
      known.push_back(peak.anchor);
      if (const auto verified = verify(peak)) found.push_back(*verified);
    }
    if (found.empty()) return std::nullopt;
    const FoundAnchor best = *std::max_element(
        found.begin(), found.end(), [](const auto& a, const auto& b) { return a.evidence.fit < b.evidence.fit; });
    const bool is_alone = std::all_of(found.begin(), found.end(), [&](const FoundAnchor& other) {
      return std::abs(other.anchor - best.anchor) <= 2 * kBeside || other.evidence.fit < best.evidence.fit - kAlike;
    });
    return is_alone ? std::optional(best) : std::nullopt;
  }

  const SlamMap& map_;
  const Keyframes& run_;
  Keyframes all_;
  const FrameReading& reading_;
  std::vector<Tried> tried_;
};

}  // namespace

bool Evidence::conclusive() const { return comparisons >= kComparisons; }

bool Evidence::may_fit() const {
  return conclusive() && fit >= std::min(kPoorFit, least_fit) && fit + 2.0 * deviation >= least_fit;
}

Evidence try_images(const SlamMap& map, const Keyframes& keyframes, const ImageOf& image_of, const Presentation& how) {
  PairingSeries series(map, kTrialLandmarks);
  for (const MapKeyframe* keyframe : keyframes) {
    const Image<Rgb>* image = image_of(*keyframe);
    if (image != nullptr) series.add(*keyframe, image->view(), how);
  }
  return evidence_of(series);
}

bool fit_presented(const SlamMap& map, const Keyframes& keyframes, const ImageOf& image_of) {
  const Presentation presentations[] = {
      {true, false, false}, {false, true, false}, {true, true, false}, {false, false, true}};
  return std::any_of(std::begin(presentations), std::end(presentations),
                     [&](const Presentation& how) { return try_images(map, keyframes, image_of, how).fits(); });
}

Keyframes keyframes_by_time(const SlamMap& map) {
  const std::vector<int> repeated = earlier_with_same_timestamp(map);
  Keyframes by_time;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    if (repeated[k] < 0) by_time.push_back(&map.keyframes[k]);
  std::stable_sort(by_time.begin(), by_time.end(),
                   [](const MapKeyframe* a, const MapKeyframe* b) { return a->timestamp < b->timestamp; });
  return by_time;
}

Keyframes first_run(const SlamMap& map, const Keyframes& by_time) {
  if (by_time.size() <= kRun) return by_time;
  const std::size_t starts = std::min(kFirst, by_time.size() - kRun + 1);
  std::vector<double> values;
  for (std::size_t i = 0; i + 1 < starts + kRun - 1; ++i)
    values.push_back(value_of_pair(map, *by_time[i], *by_time[i + 1]));
  std::size_t best = 0;
  double best_value = -1.0;
  for (std::size_t start = 0; start < starts; ++start) {
    const auto from = values.begin() + static_cast<std::ptrdiff_t>(start);
    const double value = *std::min_element(from, from + static_cast<std::ptrdiff_t>(kRun) - 1);
    if (value <= best_value) continue;
    best_value = value;
    best = start;
  }
  const auto from = by_time.begin() + static_cast<std::ptrdiff_t>(best);
  return {from, from + static_cast<std::ptrdiff_t>(kRun)};
}

Keyframes spread_pairs(const Keyframes& by_time, std::size_t pairs) {
  if (by_time.size() <= 2 * pairs) return by_time;
  Keyframes spread;
  for (std::size_t pair = 0; pair < pairs; ++pair) {
    const std::size_t at = (by_time.size() - 2) * (2 * pair + 1) / (2 * pairs);
    spread.push_back(by_time[at]);
    spread.push_back(by_time[at + 1]);
  }
  return spread;
}

std::optional<FoundAnchor> find_anchor(const SlamMap& map, const Keyframes& run, const Keyframes& more,
                                       const FrameReading& reading, std::int64_t first, std::int64_t last) {
  if (run.empty()) return std::nullopt;
  return AnchorSearch(map, run, more, reading).find(first, last);
}

}  // namespace pmsp::io
