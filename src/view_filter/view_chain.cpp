// SPDX-License-Identifier: BSD-2-Clause
#include "view_filter/view_chain.h"

#include <utility>

#include "util/median_of.h"
#include "view_filter/sharpness.h"

namespace pmsp {
namespace {

constexpr std::size_t kRecent = 3;        ///< keyframes whose sharpness is compared
constexpr double kSharedToSkip = 0.5;     ///< minimum share of the newest keyframe's landmarks, and
constexpr double kParallaxToSkip = 0.25;  ///< maximum share of the largest parallax, for a dispensable keyframe
constexpr double kHysteresis = 0.25;      ///< relative shift of thresholds in favour of the previous decision

}  // namespace

double biased_threshold(double threshold, ViewChain::Preference preference, bool lower) {
  if (preference == ViewChain::Preference::kNone) return threshold;
  return threshold * (((preference == ViewChain::Preference::kUse) == lower) ? 1.0 - kHysteresis : 1.0 + kHysteresis);
}

void ViewChain::clear() {
  empty_ = true;
  newest_landmarks_.clear();
  recent_.clear();
}

ViewChain::Verdict ViewChain::compare(const std::vector<Landmark>& landmarks, const Eigen::Vector3d& center,
                                      Preference preference) const {
  if (empty_) return {};
  if (landmarks.empty()) return {KeyframeUse::kNoLandmarks, false};
  const CommonParallax common = common_parallax(newest_landmarks_, newest_center_, landmarks, center,
                                                options_.min_parallax_deg, options_.max_parallax_deg);
  // No common landmarks: tracking was lost, and a new sequence starts.
  if (common.in_range < biased_threshold(options_.min_share, preference, true) * common.landmarks) {
    const bool near = common.median_deg < 0.5 * (options_.min_parallax_deg + options_.max_parallax_deg);
    return {near ? KeyframeUse::kTooLittleParallax : KeyframeUse::kTooMuchParallax, false};
  }
  const double shared =
      biased_threshold(kSharedToSkip, preference, false) * static_cast<double>(newest_landmarks_.size());
  const double parallax = biased_threshold(kParallaxToSkip, preference, true) * options_.max_parallax_deg;
  return {KeyframeUse::kDepthMap, common.landmarks >= shared && common.median_deg <= parallax};
}

bool ViewChain::is_blurred(const std::vector<LandmarkSharpness>& sharpness, Preference preference) const {
  if (recent_.empty()) return false;
  std::vector<double> relative;
  for (const auto& other : recent_) relative.push_back(relative_sharpness(sharpness, other));
  return median(relative) < biased_threshold(options_.min_sharpness, preference, true);
}

void ViewChain::add(const std::vector<Landmark>& landmarks, const Eigen::Vector3d& center) {
  empty_ = false;
  newest_landmarks_ = landmarks;
  newest_center_ = center;
}

void ViewChain::add_sharpness(std::vector<LandmarkSharpness> sharpness) {
  recent_.push_back(std::move(sharpness));
  if (recent_.size() > kRecent) recent_.pop_front();
}

}  // namespace pmsp
